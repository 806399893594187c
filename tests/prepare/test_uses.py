"""What a scene's glints read: a group that was found to show some has a map."""

import pytest

from glint_addon.errors import SceneError
from glint_addon.nodes import glint_bsdf
from glint_addon.prepare.uses import image_of_pixels, shown_map


@pytest.mark.parametrize("read", [shown_map, image_of_pixels])
def test_a_group_that_lost_its_map_is_named_and_a_map_asked_for(scene, read):
    group = glint_bsdf.build()
    with pytest.raises(SceneError, match=rf'^Node group "{group.name}" has no normal map: choose one'):
        read(group)
