"""The headers of osl/: each compiles alone, none grows too long to read, and a test calls each of their functions."""

import ast
import re
from pathlib import Path

import bpy
import pytest

from glint_addon import paths
from glint_addon.nodes import script_node

HEADERS = sorted(paths.shader_file("counts.h").parent.glob("*.h"))
MOST_LINES = 250
MOST_LINES_OF_FUNCTION = 60
MOST_PARAMETERS = 8
MOST_COLUMNS = 120
DEFINITION = re.compile(r"^(?:closure +)?\w+ +(\w+)\(([^()]*)\)\s*\{.*?^\}$", re.MULTILINE | re.DOTALL)
SHADER = """
#include "stdcycles.h"
#include "{name}"
shader test(output color Result = color(0))
{{
  Result = color(1);
}}
"""


def functions(header):
    """(name, number of parameters, lines) of each function that a header defines."""
    text = header.read_text(encoding="utf-8")
    return [(match[1], len([p for p in match[2].split(",") if p.strip()]), match[0].count("\n") + 1)
            for match in DEFINITION.finditer(text)]


def strings_of(source):
    """All text of string literals in Python source, but for docstrings."""
    tree = ast.parse(source)
    docstrings = {id(node.value) for node in ast.walk(tree) if isinstance(node, ast.Expr)}
    return [node.value for node in ast.walk(tree)
            if isinstance(node, ast.Constant) and isinstance(node.value, str) and id(node) not in docstrings]


def called_names():
    """Names that strings of tests call."""
    names = set()
    for file in Path(__file__).parents[1].rglob("*.py"):
        for text in strings_of(file.read_text(encoding="utf-8")):
            names |= {*re.findall(r"\b(\w+)\(", text)}
    return names


@pytest.mark.parametrize("header", HEADERS, ids=lambda header: header.name)
def test_a_header_compiles_alone(header):
    text = bpy.data.texts.new(header.name)
    text.from_string(script_node.with_headers(SHADER.format(name=header.name)))
    script_node._let_oslquery_be_imported()
    tree = bpy.data.node_groups.new(header.name, "ShaderNodeTree")
    node = tree.nodes.new("ShaderNodeScript")
    node.script = text
    if not node.bytecode or "Result" not in node.outputs:
        script_node.compile_script_node(node)
    assert node.bytecode and [*node.outputs.keys()] == ["Result"]


def breaches():
    """What is too long, as HEADER: WHAT."""
    found = set()
    for header in HEADERS:
        lines = header.read_text(encoding="utf-8").splitlines()
        if len(lines) > MOST_LINES:
            found.add(f"{header.name}: lines")
        if any(len(line) > MOST_COLUMNS for line in lines):
            found.add(f"{header.name}: width")
        for name, parameters, length in functions(header):
            if parameters > MOST_PARAMETERS:
                found.add(f"{header.name}: parameters of {name}")
            if length > MOST_LINES_OF_FUNCTION:
                found.add(f"{header.name}: lines of {name}")
    return found


def test_no_header_function_or_line_is_too_long():
    assert sorted(breaches()) == []


def test_every_definition_of_a_header_is_found():
    for header in HEADERS:
        text = header.read_text(encoding="utf-8")
        # Every block that begins at the start of a line is a function's body.
        assert len(functions(header)) == len(re.findall(r"^\{$", text, re.MULTILINE)), header.name


def test_an_osl_body_of_some_test_calls_each_function():
    defined = {name for header in HEADERS for name, _, _ in functions(header)}
    assert sorted(defined - called_names()) == []
