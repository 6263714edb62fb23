"""References to Python objects: every one must exist; those without an entry of their own are written as code."""

from __future__ import annotations

from importlib import import_module
from typing import Any

from docutils import nodes
from public_names import surface
from sphinx.addnodes import pending_xref
from sphinx.application import Sphinx
from sphinx.environment import BuildEnvironment


def resolve(app: Sphinx, env: BuildEnvironment, node: pending_xref, inner: nodes.Element) -> nodes.Node | None:
    """A link to the public name, plain code for what exists elsewhere; a warning is left for what exists nowhere."""
    if node.get("refdomain") != "py":
        return None
    target = node.get("reftarget", "")
    found = _find(target, node.get("py:module") or "")
    if found is None:
        # annotations may name what is no object by that name; a role in prose must be right
        return None if isinstance(inner, nodes.literal) else inner
    domain = env.domains.python_domain
    for path, thing in surface().items():
        if thing is found and path in domain.objects:
            return _link(app, node, inner, domain.objects[path])
    full = f"{getattr(found, '__module__', '')}.{getattr(found, '__qualname__', '')}"
    if full in domain.objects:
        return _link(app, node, inner, domain.objects[full])
    return inner


def _link(app: Sphinx, node: pending_xref, inner: nodes.Element, entry: Any) -> nodes.Node:
    uri = app.builder.get_relative_uri(node["refdoc"], entry.docname)
    link = nodes.reference("", "", internal=True, refuri=f"{uri}#{entry.node_id}")
    link.append(inner)
    return link


def _find(target: str, module: str) -> object | None:
    """The object of a dotted name, from the roots of what may be named."""
    for base in (module, "", "icmj", "icmj.errors", "icmj.controller.trigger"):
        path = f"{base}.{target}".strip(".")
        parts = path.split(".")
        for cut in range(len(parts), 0, -1):
            try:
                thing: Any = import_module(".".join(parts[:cut]))
            except (ImportError, ValueError):
                continue
            try:
                for part in parts[cut:]:
                    thing = (
                        thing.__annotations__[part]
                        if part in getattr(thing, "__annotations__", {})
                        else getattr(thing, part)
                    )
            except AttributeError:
                break
            return thing
    return None


def setup(app: Sphinx) -> dict[str, bool]:
    """Listen for references that nobody else resolves."""
    app.connect("missing-reference", resolve)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
