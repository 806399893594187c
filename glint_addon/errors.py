"""What can go wrong, as one family: each message names the thing, the cause and the next step in one sentence."""


class GlintError(Exception):
    """Base of every error the extension raises on purpose; operators and commands report its text."""


class MapError(GlintError):
    """A normal map or image cannot be used (missing, unreadable, empty, not finite)."""


class EditedError(MapError):
    """A generated image was edited since, so that making it anew would lose what a user did."""


class SceneError(GlintError):
    """The scene lacks something the job needs (object, UV map, material slot)."""


class TableError(GlintError):
    """A table cannot be written or read (read-only folder, full disk, damaged file)."""


class ShaderError(GlintError):
    """Blender cannot compile or run the OSL shaders."""


class CancelledError(GlintError):
    """Whoever asked for the work has stopped it; nothing has changed."""


class GenerateError(GlintError):
    """A microstructure cannot be generated from its settings (out of range, larger than one repeat, too many)."""
