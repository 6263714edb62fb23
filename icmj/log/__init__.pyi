from .figure import read_scene as read_scene
from .reader import read_log as read_log
from .reader import read_summary as read_summary
from .writer import write_log as write_log

__all__: list[str]
