"""Names of the custom properties that the extension keeps in .blend files. Saved files have them: none may change."""

# On any node group that Glint made: the version of its kind, a whole number.
STAMP = "glint_group"

# On a group "Glint Image Texture": True, on every copy of it.
IMAGE_TEXTURE = "glint_image_texture"

# On a group "Glint Lights": the number of its set of lights, from 1.
LIGHT_SET = "glint_lights_set"

# On a group "Glint BSDF", what it remembers of its map's tables; paths as `paths.stored_path` has them, "" for none.
TABLE = "glint_table"  # path of the table of normals
SOURCE = "glint_source"  # `map_state` of the map whose tables these are; "" where there are none
SIZE = "glint_size"  # width and height of the map, in texels
SLOPE_LOW = "glint_slope_low"  # smallest slopes of the map, along u and v
SLOPE_HIGH = "glint_slope_high"  # largest slopes of the map, along u and v
INDEX = "glint_index"  # path of the index
COUNTS = "glint_counts"  # path of the counts
COUNTS_LEVELS = "glint_counts_levels"  # sides of the blocks of the first and the last level of the counts, in texels
BIN_LOW = "glint_bin_low"  # corner of the counts' slope box with the smallest slopes
BIN_HIGH = "glint_bin_high"  # corner of the counts' slope box with the largest slopes
FLAKES = "glint_flakes"  # path of the table of flakes

# On a group "Glint BSDF" of version 9 or before, what it reads and how: its nodes say so today.
OLD_IMAGE = "glint_image"  # pointer to the map
OLD_INTERPOLATION = "glint_interpolation"  # as `MapBinding` has it, like all that follow
OLD_CONVENTION = "glint_convention"
OLD_DISTRIBUTION = "glint_distribution"
OLD_UV_MAP = "glint_uv_map"
OLD_EXTENSION = "glint_extension"
OLD_PROPERTIES = (OLD_IMAGE, OLD_INTERPOLATION, OLD_CONVENTION, OLD_DISTRIBUTION, OLD_UV_MAP, OLD_EXTENSION)

# On an image that is a copy of another, to be read as data.
COPY_OF = "glint_copy_of"  # full name of the original
COPY_STATE = "glint_copy_state"  # `image_state` of the original when it was copied
COPY_CONTENT = "glint_copy_content"  # what the copy itself held then, which tells whether it was given other pixels

# On an object that shows a "Glint Scale": metres that one unit of its active UV map covers, divided by the object's
# mean scale; of other UV maps too, under this name and a digest of theirs.
UV_METRES = "glint_uv_metres"
# On an image that was generated.
GENERATED = "glint_generated"  # JSON of the recipe it shows
GENERATED_CONTENT = "glint_generated_content"  # digest of what was packed then, which tells whether it was edited
GENERATED_PART = "glint_generated_part"  # which of the images of a recipe it is
GENERATED_PRESENCE = "glint_generated_presence"  # on the normal map: pointer to the image of where flakes are
GENERATED_COLOR = "glint_generated_color"  # on the normal map: pointer to the image of their colours

# On a scene.
HOLDER = "glint_lights"  # pointer to the data-block with its lights
PREPARED = "glint_prepared"  # digest and JSON of its facts when it was prepared
SWITCHED_ON = "glint_switched_osl_on"  # True where it was Glint that switched Open Shading Language on

# On the data-block with a scene's lights: the numbers of a set; the number of that set follows.
LIGHTS_KEY = "lights_"
