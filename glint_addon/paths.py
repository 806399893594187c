"""The only module that knows where files are: shaders, tables, the user's folder."""

from pathlib import Path

PACKAGE = __package__
ROOT = Path(__file__).resolve().parent.parent
OSL_FOLDER = ROOT / "osl"
TABLE_FOLDER_NAME = "glint_tables"


def shader_file(name: str) -> Path:
    """Source of the OSL shader or header `name`, for example "glint.osl" or "footprint.h"."""
    return OSL_FOLDER / name


def table_folder(blend_file: str = "") -> Path:
    """Folder for baked tables: beside the saved .blend `blend_file`, else the user's own (see `user_folder`).

    The folder is not created here.
    """
    if blend_file:
        return Path(blend_file).parent / TABLE_FOLDER_NAME
    return user_folder() / TABLE_FOLDER_NAME


def stored_path(file: Path) -> str:
    """How files keep the path of a table: relative to the open .blend file ("//glint_tables/...") if it lies beside it.

    Blender itself resolves such paths when it renders; links are left as they are. So folders can be moved, copied and
    mounted elsewhere. In groups that are linked from another file too it resolves them from the open file (5.2.3).
    """
    import bpy

    if bpy.data.filepath and file.parent == table_folder(bpy.data.filepath):
        return f"//{TABLE_FOLDER_NAME}/{file.name}"
    return str(file)


def disk_path(stored: str) -> Path:
    """Where Blender looks for the file with that `stored_path`."""
    import bpy

    return Path(bpy.path.abspath(stored))


def user_folder() -> Path:
    """A folder the user may write to; the extension's own folder may be read-only."""
    import bpy

    if PACKAGE.startswith("bl_ext."):
        # The extension's package is the parent of this one.
        return Path(bpy.utils.extension_path_user(PACKAGE.rpartition(".")[0], create=False))
    return Path(bpy.utils.user_resource("DATAFILES")) / "glint"


def preset_folder() -> Path:
    """Folder of the presets' files, which come with the extension."""
    return Path(__file__).resolve().parent / "presets"
