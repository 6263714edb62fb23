"""The documentation site: Markdown pages, and reference made from the code itself.

``sphinx-build -W -n docs docs/build/html`` builds it, without the network.
"""

from __future__ import annotations

import importlib.util
import re
import sys
from pathlib import Path

HERE = Path(__file__).parent
sys.path[:0] = [str(HERE.parent), str(HERE / "_ext")]

from figure_style import apply_style  # noqa: E402

from icmj.base import VERSION  # noqa: E402

project, author, release = "icmj", "The icmj developers", VERSION
project_copyright = author
extensions = [
    "myst_parser",
    "sphinx.ext.autodoc",
    "sphinx.ext.napoleon",
    "sphinx.ext.viewcode",
    "sphinx_copybutton",
    "sphinx_design",
    "sphinx_gallery.gen_gallery",
    "command_line",
    "docstrings",
    "facts",
    "links",
    "live_pages",
    "mathml",
    "measures",
    "pages",
    "promises",
    "public_names",
    "run_file",
    "terms",
]
exclude_patterns = [
    "questions.md",
    "build",
    "_ext",
    "gallery/*.py",
    "gallery/*.ipynb",
    "gallery/*.zip",
    "sg_execution_times.rst",
]
nitpicky = True
suppress_warnings = ["config.cache"]

myst_enable_extensions = ["dollarmath", "amsmath", "deflist", "colon_fence", "attrs_inline"]
myst_heading_anchors = 3
html_math_renderer = "mathml"

autodoc_member_order = "bysource"
autodoc_typehints_format = "short"
python_use_unqualified_type_names = True
python_maximum_signature_line_length = 88
napoleon_numpy_docstring = False
napoleon_attr_annotations = False
napoleon_custom_sections = [("Attributes", "params_style"), ("Yields", "returns_style")]
viewcode_line_numbers = True


def _tell_where(gallery_conf: dict, script: dict) -> list[str]:
    """No arguments for an example, and what Python tells every script: where it lies."""
    script["example_globals"]["__file__"] = script["src_file"]
    return []


class ByQuestion:
    """The order of the gallery: what a researcher asks first, then models from elsewhere."""

    ORDER = (
        "disturbed_stance", "sway", "backpack", "delay", "deciding", "masquerade", "lean", "attraction",
        "rigid_person", "own_plant", "muscle", "ball_joint",
    )  # fmt: skip

    def __init__(self, folder: str) -> None:
        self.folder = folder

    def __call__(self, name: str) -> tuple[int, str]:
        stem = Path(name).stem
        return (self.ORDER.index(stem) if stem in self.ORDER else len(self.ORDER), name)


def _lacking(example: Path) -> list[str]:
    """Libraries that an example looks for and that are not installed; such an example is shown, and not run."""
    wanted = re.findall(r'find_spec\("(\w+)"\)', example.read_text(encoding="utf-8"))
    return [name for name in wanted if importlib.util.find_spec(name) is None]


NOT_RUN = {example.stem: _lacking(example) for example in sorted((HERE.parent / "examples").glob("*.py"))}
for example, lacking in NOT_RUN.items():
    if lacking:
        print(f"examples/{example}.py is shown without being run: {' and '.join(lacking)} not installed")

sphinx_gallery_conf = {
    "reset_argv": _tell_where,
    "reset_modules": ("matplotlib", apply_style),
    "examples_dirs": "../examples",
    "gallery_dirs": "gallery",
    "filename_pattern": rf"/(?!(?:{'|'.join(name for name, lacking in NOT_RUN.items() if lacking)})\.py)\w+\.py",
    "within_subsection_order": ByQuestion,
    "download_all_examples": False,
    "show_memory": False,
    "show_signature": False,
    "remove_config_comments": True,
    "min_reported_time": 1e9,
    "abort_on_example_error": True,
}

html_theme = "furo"
html_title = f"icmj {release}"
html_static_path = ["_static"]
html_css_files = ["site.css"]
html_theme_options = {
    "light_css_variables": {"color-brand-primary": "#1f5f8b", "color-brand-content": "#1f5f8b"},
    "dark_css_variables": {"color-brand-primary": "#7fb8e0", "color-brand-content": "#7fb8e0"},
}
html_show_sphinx = False
html_copy_source = False
copybutton_prompt_text = r">>> |\.\.\. |\$ "
copybutton_prompt_is_regexp = True
