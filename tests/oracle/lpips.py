"""Oracle of LPIPS (M3): the network with scipy's correlation and loops, float64."""

import numpy as np
from scipy.signal import correlate

STRIDE, PADDING = (4, 1, 1, 1, 1), (2, 2, 1, 1, 1)


def convolve(image, kernel, stride, padding):
    wide = np.pad(image, ((0, 0), (padding,) * 2, (padding,) * 2))
    return np.stack([correlate(wide, k, mode="valid", method="direct")[0, ::stride, ::stride] for k in kernel])


def pool(image):
    rows, columns = (image.shape[1] - 3) // 2 + 1, (image.shape[2] - 3) // 2 + 1
    out = np.empty((len(image), rows, columns))
    for y in range(rows):
        for x in range(columns):
            out[:, y, x] = image[:, 2 * y : 2 * y + 3, 2 * x : 2 * x + 3].max(axis=(1, 2))
    return out


def features(image, arrays):
    image = (image - arrays["shift"][:, None, None]) / arrays["scale"][:, None, None]
    for layer in range(5):
        if layer in (1, 2):
            image = pool(image)
        image = convolve(image, arrays[f"conv{layer + 1}_weight"], STRIDE[layer], PADDING[layer])
        image = np.maximum(0, image + arrays[f"conv{layer + 1}_bias"][:, None, None])
        yield image / (np.linalg.norm(image, axis=0) + 1e-10)


def lpips(a, b, arrays):
    """Inputs as the network takes them, before shift and scale."""
    arrays = {key: value.astype(float) for key, value in arrays.items()}
    total = 0.0
    for layer, (one, other) in enumerate(zip(features(a, arrays), features(b, arrays))):
        total += (arrays[f"lin{layer + 1}_weight"][:, None, None] * (one - other) ** 2).sum(axis=0).mean()
    return total
