"""Normal maps made by code: flakes, bumps, brushed metal, scratches; seeded and tileable.

Every function returns encoded tangent-space normals, float32 (size, size, 3) in 0..1: rgb = (n + 1) / 2, OpenGL
convention (+Y up the picture), row 0 at the bottom (v = 0), as Blender stores pixels. A slope is n.x / n.z or
n.y / n.z, so that a height h(u, v) has the slopes -dh/du and -dh/dv; sizes are in texels. Maps repeat without a seam.
"""

from __future__ import annotations

import bpy
import numpy as np


def flakes(size=1024, *, std=0.25, cell=1, seed=1) -> np.ndarray:
    """Flat mirror flakes, each tilted on its own: metallic paint, glitter.

    std: standard deviation of the flakes' slopes along each axis (normal distribution); cell: mean width of a flake.
    At cell = 1 each texel is a flake; above, flakes are the Voronoi cells of points jittered in a grid. Use Closest.
    Raises ValueError if cell does not divide size (the map would have a seam).
    """
    if size % cell:
        raise ValueError(f"Flakes of {cell} texels do not fit a map of {size}: choose a divisor of the size.")
    rng = np.random.default_rng(seed)
    count = size // cell
    tilt = rng.normal(0.0, std, (count, count, 2))
    if cell == 1:
        return encoded_normals(tilt)
    row, column = _nearest_points(rng.random((count, count, 2)), size)
    return encoded_normals(tilt[row, column])


def bumps(size=1024, *, std=0.15, width=8.0, seed=1) -> np.ndarray:
    """Isotropic random bumps: hammered or orange-peel surfaces, water. Use Linear.

    A Gaussian random height field: white noise filtered to the autocorrelation exp(-d^2 / (2 width^2)).
    std: standard deviation of the slope along each axis, exactly, so that its moments are known (the price: a curl of a
    fraction of a percent); width: correlation length.
    """
    slopes = _random_slopes(size, (width, width), seed)
    return encoded_normals(slopes / slopes.std(axis=(0, 1)) * std)


def brushed(size=1024, *, std=0.2, width=1.5, length=60.0, seed=1) -> np.ndarray:
    """Brushed metal: streaks along u. Use Linear.

    The height field of `bumps` with two correlation lengths: `length` along u and `width` across it. std is the
    standard deviation of the slope across the streaks; along them it is about std * width / length, because
    both are derivatives of one height field.
    """
    slopes = _random_slopes(size, (length, width), seed)
    return encoded_normals(slopes * std / slopes[..., 1].std())


def scratches(size=1024, *, count=300, width=5.0, length=300.0, std=0.25, spread=0.15, seed=1) -> np.ndarray:
    """Polished metal with straight scratches, flat between them. Use Linear.

    Each of `count` grooves has a cosine profile `width` wide, a length around `length`, a random place, and a direction
    normally distributed around u with a standard deviation of `spread` radians (large: any direction). Where grooves
    cross the deeper one is seen. std: standard deviation of the slope across a groove of mean depth.
    """
    rng = np.random.default_rng(seed)
    height = np.zeros((size, size))
    for _ in range(count):
        place = rng.random(2) * size
        angle = rng.normal(0.0, spread)
        depth = rng.uniform(0.5, 1.5)
        _carve(height, place, angle, length * rng.uniform(0.5, 1.5), width, depth)

    # Central differences over the seam; a cosine groove of depth 1 has the rms slope pi / (sqrt(2) width).
    unit = np.pi / (np.sqrt(2.0) * width)
    along_u = (np.roll(height, -1, 1) - np.roll(height, 1, 1)) / 2
    along_v = (np.roll(height, -1, 0) - np.roll(height, 1, 0)) / 2
    return encoded_normals(-np.stack([along_u, along_v], axis=-1) * std / unit)


def encoded_normals(slopes) -> np.ndarray:
    """Encode slopes (height, width, 2) as colours: float32 (height, width, 3), rgb = (normal + 1) / 2."""
    normals = np.concatenate([slopes, np.ones_like(slopes[..., :1])], axis=-1)
    normals /= np.linalg.norm(normals, axis=-1, keepdims=True)
    return (normals * 0.5 + 0.5).astype(np.float32)


def decoded_slopes(encoded) -> np.ndarray:
    """Slopes (height, width, 2) of encoded normals: the inverse of `encoded_normals`."""
    normals = np.asarray(encoded, np.float64) * 2 - 1
    return normals[..., :2] / normals[..., 2:]


def blender_image(name, pixels, *, is_data=True) -> bpy.types.Image:
    """A new image data-block of float pixels (height, width, 3), row 0 at the bottom; data is Non-Color."""
    height, width = pixels.shape[:2]
    image = bpy.data.images.new(name, width, height, float_buffer=is_data, is_data=is_data)
    rgba = np.concatenate([pixels, np.ones_like(pixels[..., :1])], axis=-1)
    image.pixels.foreach_set(rgba.astype(np.float32).ravel())
    image.update()
    return image


def _nearest_points(jitter, size):
    """Row and column, each (size, size), of the point nearest to each texel; jitter (n, n, 2) is its place in its cell.

    Only the 3 x 3 cells around are searched: a nearer point two cells away is rare and only moves an edge.
    """
    count = len(jitter)
    place = (np.arange(size) + 0.5) * count / size
    cell = np.floor(place).astype(int)
    best = np.full((size, size), np.inf)
    row = np.zeros((size, size), int)
    column = np.zeros((size, size), int)
    for down in (-1, 0, 1):
        for right in (-1, 0, 1):
            r = ((cell + down) % count)[:, None]
            c = ((cell + right) % count)[None, :]
            x = (cell + right)[None, :] + jitter[r, c, 0] - place[None, :]
            y = (cell + down)[:, None] + jitter[r, c, 1] - place[:, None]
            distance = x * x + y * y
            nearer = distance < best
            best = np.where(nearer, distance, best)
            row = np.where(nearer, r, row)
            column = np.where(nearer, c, column)
    return row, column


def _random_slopes(size, lengths, seed):
    """Slopes (size, size, 2) of a Gaussian random height field, not yet scaled.

    lengths: correlation lengths along u and v. The spectrum of exp(-d^2 / (2 l^2)) is exp(-(l k)^2 / 2), so white
    noise is multiplied by its square root; the derivative along an axis multiplies by i k.
    """
    k = 2 * np.pi * np.fft.fftfreq(size)
    ku, kv = k[None, :], k[:, None]
    noise = np.fft.fft2(np.random.default_rng(seed).normal(size=(size, size)))
    height = noise * np.exp(-((lengths[0] * ku) ** 2 + (lengths[1] * kv) ** 2) / 4)
    return np.stack([np.fft.ifft2(-1j * k_axis * height).real for k_axis in (ku, kv)], axis=-1)


def _carve(height, place, angle, length, width, depth):
    """Lower `height` in place to one groove's: a segment from `place` (u, v) along `angle`, wrapping over the seams."""
    size = len(height)
    cosine, sine = np.cos(angle), np.sin(angle)
    ends = np.array([place, place + length * np.array([cosine, sine])])
    low = np.floor(ends.min(axis=0) - width).astype(int)
    high = np.ceil(ends.max(axis=0) + width).astype(int)
    u = np.arange(low[0], high[0]) + 0.5 - place[0]
    v = np.arange(low[1], high[1])[:, None] + 0.5 - place[1]
    along = u * cosine + v * sine
    across = v * cosine - u * sine

    # A cosine across; both ends rise over one width, so that the groove has no wall.
    profile = np.where(np.abs(across) < width / 2, 0.5 + 0.5 * np.cos(2 * np.pi * across / width), 0.0)
    ramp = np.clip(np.minimum(along, length - along) / width, 0.0, 1.0)
    groove = -depth * profile * ramp
    rows = np.arange(low[1], high[1]) % size
    columns = np.arange(low[0], high[0]) % size
    for start_v in range(0, len(rows), size):
        for start_u in range(0, len(columns), size):
            # A groove longer than the map covers a texel more than once: carve one repeat at a time.
            area = np.ix_(rows[start_v : start_v + size], columns[start_u : start_u + size])
            height[area] = np.minimum(height[area], groove[start_v : start_v + size, start_u : start_u + size])
