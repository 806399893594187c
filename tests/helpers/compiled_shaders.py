"""OSL shaders compiled once a process: each Glint BSDF group compiles the same source, in 50 ms, thousands of times."""

from __future__ import annotations

from pathlib import Path

import _cycles


def keep_compiled_shaders():
    """Let Cycles' compiler answer with what it made of the same source before. What fails is compiled each time."""
    compiled, compile_file = {}, _cycles.osl_compile

    def compile_once(source: str, target: str) -> bool:
        text = Path(source).read_bytes()
        if text in compiled:
            Path(target).write_bytes(compiled[text])
            return True
        is_compiled = compile_file(source, target)
        if is_compiled:
            compiled[text] = Path(target).read_bytes()
        return is_compiled

    _cycles.osl_compile = compile_once
