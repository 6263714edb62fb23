from .figure import read_scene as read_scene
from .reader import read_any as read_any
from .reader import read_log as read_log
from .reader import read_summary as read_summary
from .reader import read_trial as read_trial
from .writer import write_log as write_log

__all__: list[str]
