"""What the documents cite is there: paths, modules, functions, make targets, options, pictures and sections."""

import re
import subprocess
from functools import cache
from pathlib import Path

import pytest

from tests.package.test_layout import ALLOWED

ROOT = Path(__file__).resolve().parents[2]
DOCS = sorted([*(ROOT / "docs").glob("*.md"), *(ROOT / name for name in (
    "README.md", "CONTRIBUTING.md", "CHANGELOG.md", "benchmarks/README.md", "demo_scenes/README.md"))])
README_WORDS = 900
CHANGELOG_LINES = 20  # a version
FILES_TO_TOUCH = 5  # for one of the changes that docs/walk.md lists

SOURCE_ENDINGS = {"py", "h", "osl", "md", "toml", "json", "yaml", "png", "svg", "sh"}
# Folders that a path may start from, besides the document's own and the repository.
BASES = ("", "glint_addon", "osl", "tests", "benchmarks", "demo_scenes")
BUILT = {"out/", "dist/"}  # folders that make creates
# Names that are Blender's, a library's, or a user's, not this repository's.
NOT_OURS = {
    "Dx", "Dy", "NAME_prepared.blend", "conductor_bsdf", "dielectric_bsdf", "generalized_schlick_bsdf",
    "gettextureinfo", "microfacet_f82_tint", "template.yaml",
}
# How Python and the shading language begin what they define.
DEFINED = (r"^\s*(?:def|class|struct|shader|#define|closure color|int|float|void|vector|color|[A-Z]\w+) {name}\b"
           r"|^{name}\b")
# Options of Blender, of farms, of pytest and of package tools.
OPTIONS_OF_OTHERS = {"--command", "--cycles-device", "--background", "--python", "--repo", "--enable", "--gpu-backend",
                     "--durations"}
# Words that were hard to understand, and may not come back.
FORBIDDEN = (
    "lights whose glints it can tell", "turning the camera or a light by hand", "to what it missed",
    "points behind an area lamp do not look for it", "far views of the largest maps lose", "asks one a sample",
    "four slopes in ten thousand", "lean slightly",
)


@cache
def source() -> str:
    """All text of the repository's code, in which names are looked up."""
    files = [file for folder in ("glint_addon", "osl", "benchmarks", "demo_scenes", "tests", "tools", "farm")
             for ending in ("py", "h", "osl", "yaml", "sh") for file in (ROOT / folder).rglob(f"*.{ending}")
             if file != Path(__file__)]
    files += [ROOT / "Makefile", ROOT / "pyproject.toml", ROOT / "blender_manifest.toml", ROOT / "__init__.py"]
    return "\n".join(file.read_text(encoding="utf-8") for file in files)


@cache
def file_names() -> frozenset:
    """Names of the repository's files, without folders."""
    listed = subprocess.run(["git", "ls-files", "--cached", "--others", "--exclude-standard"], cwd=ROOT, check=True,
                            capture_output=True, text=True)
    return frozenset(line.rpartition("/")[2] for line in listed.stdout.splitlines())


def section(heading: str) -> str:
    """The name by which a link reaches a heading, as GitHub makes it."""
    return re.sub(r"[^\w\- ]", "", heading.replace("`", "").strip().lower()).replace(" ", "-")


def sections(text: str) -> set:
    """Names of all headings."""
    return {section(line.lstrip("#")) for line in text.splitlines() if re.match(r"#+ ", line)}


def wrong_links(text: str, doc: Path) -> list[str]:
    """Links and pictures that lead nowhere."""
    wrong = []
    for target in re.findall(r"\]\(([^)\s]+)\)", text):
        if re.match(r"https?:", target):
            continue
        path, _, anchor = target.partition("#")
        file = doc if path == "" else (doc.parent / path).resolve()
        is_page = file.suffix == ".md" and file.exists()
        page = text if path == "" else file.read_text(encoding="utf-8") if is_page else ""
        if not file.exists() or anchor and anchor not in sections(page):
            wrong.append(f"link {target}")
    return wrong


def is_path(word: str) -> bool:
    """Whether a quoted word means a file or folder of this repository."""
    ending = word.rpartition(".")[2]
    return bool(re.fullmatch(r"[a-z_][\w./-]*", word)) and (
        ending in SOURCE_ENDINGS and word.count(".") == 1 or word.endswith("/") and word not in BUILT)


def is_there(word: str, doc: Path) -> bool:
    """Whether a path is there, from where one would look for it."""
    return any((base / word).exists() for base in (doc.parent, *(ROOT / base for base in BASES))) or (
        "/" not in word and word in file_names())


def is_defined(name: str) -> bool:
    """Whether a name is a function, class, struct, shader or constant of the code."""
    return re.search(DEFINED.format(name=name), source(), re.MULTILINE) is not None


def wrong_names(text: str, doc: Path) -> list[str]:
    """Quoted paths, functions and other names of the code that are not there."""
    wrong = []
    for word in re.findall(r"(?<!`)`([^`\n]+)`(?!`)", text):
        name = re.match(r"([A-Za-z_][\w.]*?)(\(\S*\))?$", word)
        if word in NOT_OURS or name and name[1] in NOT_OURS:
            continue
        if is_path(word):
            wrong += [] if is_there(word, doc) else [f"path {word}"]
        elif name and name[2]:
            wrong += [] if is_defined(name[1].rpartition(".")[2]) else [f"function {word}"]
        elif name and ("_" in word or "." in word) and not word.endswith("_"):
            found = all(re.search(rf"\b{part}\b", source()) for part in name[1].split(".") if part)
            wrong += [] if found else [f"name {word}"]
    return wrong


PLACED = re.compile(r"`([\w./]+\.(?:py|h|osl))`:\s`(\w+)\(\)`|`(\w+)\(\)`(?:,[^`,]*,)?\sin\s`([\w./]+\.(?:py|h|osl))`")


def wrong_places(text: str, doc: Path) -> list[str]:
    """Functions that a text places in a file which has them not: "`file`: `function()`" or "`function()` in `file`"."""
    wrong = []
    for match in PLACED.finditer(text):
        path, name = match[1] or match[4], match[2] or match[3]
        files = [base / path for base in (doc.parent, *(ROOT / base for base in BASES)) if (base / path).is_file()]
        code = files[0].read_text(encoding="utf-8") if files else ""
        if files and not re.search(DEFINED.format(name=name), code, re.MULTILINE):
            wrong.append(f"function {name} in {path}")
    return wrong


def commands(text: str) -> str:
    """All that is written as code: quoted words and indented lines."""
    quoted = re.findall(r"`([^`\n]+)`", text)
    return "\n".join(quoted + [line for line in text.splitlines() if line.startswith("    ")])


def wrong_commands(text: str) -> list[str]:
    """Make targets, modules run with -m, and options that are not there."""
    code = commands(text)
    makefile = (ROOT / "Makefile").read_text(encoding="utf-8")
    wrong = [f"target {target}" for target in re.findall(r"(?:^|\s)make ([a-z][\w-]*)", code, re.MULTILINE)
             if not re.search(rf"^{target}:", makefile, re.MULTILINE)]
    for module in re.findall(r"python -m ([\w.]+)", code):
        path = ROOT / module.replace(".", "/")
        if not path.with_suffix(".py").is_file() and not (path / "__main__.py").is_file():
            wrong.append(f"module {module}")
    for option in re.findall(r"(?<![\w-])--[a-z][a-z-]*", code):
        no_form = option.replace("--no-", "--")
        known = option in OPTIONS_OF_OTHERS or f'"{option}"' in source() or f'"{no_form}"' in source()
        wrong += [] if known or f" {option}" in makefile else [f"option {option}"]
    return wrong


def wrong_in(text: str, doc: Path) -> list[str]:
    """All that `text`, which stands in `doc`, cites and that is not there."""
    return wrong_links(text, doc) + wrong_names(text, doc) + wrong_places(text, doc) + wrong_commands(text)


@pytest.mark.parametrize("doc", DOCS, ids=lambda doc: str(doc.relative_to(ROOT)))
def test_what_a_document_cites_is_there(doc):
    assert wrong_in(doc.read_text(encoding="utf-8"), doc) == []


@pytest.mark.parametrize(("text", "wrong"), [
    ("See `glint_addon/bake/tabel.py`.", "path glint_addon/bake/tabel.py"),
    ("See `osl/query.hpp/`.", "path osl/query.hpp/"),
    ("First `osl/query.h`: `glint_lobe()`.", "function glint_lobe in osl/query.h"),
    ("First `glint_lobe()` in `osl/query.h`.", "function glint_lobe in osl/query.h"),
    ("It calls `prepare_scenes()`.", "function prepare_scenes()"),
    ("It reads `glint_addon.create_glint_materials`.", "name glint_addon.create_glint_materials"),
    ("![Panel](docs/panels.png)", "link docs/panels.png"),
    ("[Lights](README.md#no-such-section)", "link README.md#no-such-section"),
    ("[Here](#nor-this)", "link #nor-this"),
    ("    make tests", "target tests"),
    ("Run `python -m benchmarks.sweeps`.", "module benchmarks.sweeps"),
    ("Run `python -m glint_addon render --sampels 4`.", "option --sampels"),
])
def test_a_wrong_citation_is_found(text, wrong):
    assert wrong_in(text, ROOT / "README.md") == [wrong]


def test_right_citations_of_each_kind_pass():
    text = ("See `glint_addon/bake/table.py`, `bake/table.py`, `query.h`, `prepare_scene()`, "
            "`glint_addon.prepare_scene`; run `make test`, `python -m benchmarks.sweep`, "
            "`python -m glint_addon render --samples 4`; [install](README.md#install), ![flakes](docs/flakes_far.png).")
    assert wrong_in(text, ROOT / "README.md") == []


def test_the_readme_is_short_enough_for_an_artist():
    assert len((ROOT / "README.md").read_text(encoding="utf-8").split()) <= README_WORDS


def lines_by_version(changelog: str) -> dict[str, int]:
    """How many lines with words each version of a changelog has, without its heading."""
    parts = re.split(r"^## (.*)$", changelog, flags=re.MULTILINE)[1:]
    return {name: sum(bool(line.strip()) for line in body.splitlines())
            for name, body in zip(parts[::2], parts[1::2], strict=True)}


def test_the_changelog_has_few_lines_a_version():
    found = lines_by_version((ROOT / "CHANGELOG.md").read_text(encoding="utf-8"))
    assert found and max(found.values()) <= CHANGELOG_LINES, found
    assert lines_by_version("# C\n\n## 1\n\n- a\n  b\n\n## 0\n\n- c\n") == {"1": 2, "0": 1}


def forbidden_in(text: str) -> list[str]:
    """The forbidden words that a text has, over line ends too."""
    plain = " ".join(text.lower().split())
    return [words for words in FORBIDDEN if words in plain]


@pytest.mark.parametrize("doc", DOCS, ids=lambda doc: str(doc.relative_to(ROOT)))
def test_no_document_has_words_that_were_hard_to_understand(doc):
    assert forbidden_in(doc.read_text(encoding="utf-8")) == []


def test_forbidden_words_are_found_across_a_line_end():
    assert forbidden_in("the features lean\n  slightly") == ["lean slightly"]


def changes_listed(walk: str) -> dict[str, list[str]]:
    """The newcomer's changes of docs/walk.md, each with the files to touch."""
    parts = re.split(r"^### (.*)$", walk.partition("## The newcomer")[2], flags=re.MULTILINE)[1:]
    return {name: re.findall(r"^\d\. `([^`]+)`", body, re.MULTILINE)
            for name, body in zip(parts[::2], parts[1::2], strict=True)}


def rooms_listed(walk: str) -> dict[str, set[str]]:
    """What each room of docs/walk.md's table may import."""
    rows = re.findall(r"^\| `(\w+)` \|[^|]*\|([^|]*)\|$", walk, re.MULTILINE)
    return {room: set(re.findall(r"`(\w+)`", imports)) for room, imports in rows}


def test_the_map_of_the_rooms_is_the_table_of_allowed_imports():
    rooms = {room: imports for room, imports in ALLOWED.items() if room not in {"", "__main__"}}
    assert rooms_listed((ROOT / "docs" / "walk.md").read_text(encoding="utf-8")) == rooms


def test_each_common_change_touches_few_files():
    changes = changes_listed((ROOT / "docs" / "walk.md").read_text(encoding="utf-8"))
    assert len(changes) == 10
    for name, files in changes.items():
        assert 1 <= len(files) <= FILES_TO_TOUCH, name


def test_a_list_of_six_files_is_counted():
    lines = "\n".join(f"{number}. `osl/query.h`: x" for number in range(1, 7))
    walk = f"## The newcomer's test\n\n### Add a light kind\n\n{lines}"
    assert changes_listed(walk) == {"Add a light kind": ["osl/query.h"] * 6}
