from .figure import read_scene as read_scene
from .reader import read_summary as read_summary

__all__: list[str]
