"""The comparison report: figures, sections, page. Built from logs alone."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach(
    __name__, submodules=["plots"], submod_attrs={"builder": ["build_report"], "live": ["build_live"]}
)
