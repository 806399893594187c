"""OSL Script nodes that carry their shader inside the .blend: files then render where the add-on is not installed."""

from __future__ import annotations

import re
import sys
from pathlib import Path

import bpy

from .. import paths
from ..errors import ShaderError

LOCAL_INCLUDE = re.compile(r'^[ \t]*#include[ \t]+"([^"]+)"[ \t]*$', re.MULTILINE)
ONCE = "#pragma once\n"  # in headers, for other compilers than Blender's


def osl_available() -> bool:
    """Whether this Blender's Cycles was built with Open Shading Language."""
    return bool(bpy.app.build_options.cycles_osl)


def shader_source(name: str) -> str:
    """Source of osl/`name` with our own headers put in place of their #include lines, each once.

    Headers that are not in the osl folder (stdcycles.h) are left to Blender's compiler.
    Raises ShaderError if a file is missing.
    """
    return with_headers(_read(paths.shader_file(name)))


def with_headers(text: str) -> str:
    """`text` with our own headers put in place of its #include lines, as `shader_source`."""
    seen = set()

    def replacement(match):
        header = paths.shader_file(match[1])
        if not header.is_file():
            return match[0]
        if header in seen:
            return ""
        seen.add(header)
        return LOCAL_INCLUDE.sub(replacement, _read(header).removeprefix(ONCE))

    return LOCAL_INCLUDE.sub(replacement, text)


def _read(file: Path) -> str:
    try:
        return file.read_text(encoding="utf-8")
    except OSError as error:
        raise ShaderError(f"Shader {file.name} cannot be read ({error.strerror}): reinstall Glint.") from error


def shader_text(name: str) -> bpy.types.Text:
    """Text data-block "Glint <name>" holding `shader_source(name)`; refreshed when the shipped source changed."""
    source = shader_source(name)
    title = f"Glint {name}"
    text = bpy.data.texts.get((title, None))
    if text is None:
        text = bpy.data.texts.new(title)
    if text.as_string() != source:
        text.from_string(source)
    return text


def add_script_node(group, name: str, label: str = ""):
    """Add a Script node running osl/`name` to `group`; None where Blender has no OSL.

    Raises ShaderError if the shader does not compile.
    """
    if not osl_available():
        return None
    _let_oslquery_be_imported()
    node = group.nodes.new("ShaderNodeScript")
    node.name = node.label = label or name
    node.mode = "INTERNAL"
    node.script = shader_text(name)  # Cycles compiles the node when its script is set
    if not node.bytecode:
        compile_script_node(node)  # again, for the compiler's words
    return node


def compile_script_node(node):
    """Compile the node's text and make its sockets; the bytecode is stored in the node.

    Raises ShaderError with the compiler's words if that fails.
    """
    from cycles import osl

    messages = []
    if not osl.update_script_node(node, lambda kind, text: messages.append(text)):
        raise ShaderError(f"Shader {node.script.name} does not compile ({'; '.join(messages)}): report this as a bug.")


def _let_oslquery_be_imported():
    """Put Blender's own site-packages on sys.path: the pip module bpy has oslquery and OpenImageIO only there."""
    scripts = Path(bpy.utils.system_resource("SCRIPTS"))
    version = f"python{sys.version_info.major}.{sys.version_info.minor}"
    for folder in (scripts.parent / "python" / "lib" / version / "site-packages",):
        if folder.is_dir() and str(folder) not in sys.path:
            sys.path.append(str(folder))
