"""LPIPS (M3): known values with the real weights, an oracle with made-up weights, and weights that are wrong."""

import numpy as np
import pytest

from data_folder import data_folder
from endotsr.errors import InputError
from endotsr.results.evaluation import lpips as module
from endotsr.results.evaluation.lpips import layer_distances, load_lpips_weights, lpips, lpips_obstacle
from oracle import lpips as oracle


def made_up_arrays():
    """A seeded network of the right shapes: features neither die nor grow."""
    rng = np.random.default_rng(5)
    arrays = {"shift": np.array([-0.03, -0.088, -0.188]), "scale": np.array([0.458, 0.448, 0.45])}
    sizes = zip(module.CHANNELS[:-1], module.CHANNELS[1:], module.KERNELS)
    for layer, (before, after, size) in enumerate(sizes, start=1):
        spread = np.sqrt(2 / (before * size * size))
        arrays[f"conv{layer}_weight"] = spread * rng.standard_normal((after, before, size, size))
        arrays[f"conv{layer}_bias"] = 0.1 * rng.standard_normal(after)
        arrays[f"lin{layer}_weight"] = rng.uniform(0, 1, after)
    return {key: value.astype(np.float32) for key, value in arrays.items()}


@pytest.fixture(scope="module")
def weights_file(tmp_path_factory):
    path = tmp_path_factory.mktemp("lpips") / "made_up.npz"
    np.savez(path, **made_up_arrays())
    return path


@pytest.fixture
def no_weights_anywhere(monkeypatch, tmp_path):
    monkeypatch.delenv("ENDOTSR_LPIPS", raising=False)
    monkeypatch.setenv("XDG_DATA_HOME", str(tmp_path))
    monkeypatch.setattr(module, "default_weights_path", lambda: tmp_path / "endotsr" / "lpips_alex.npz")
    return tmp_path / "endotsr" / "lpips_alex.npz"


@pytest.mark.parametrize("height, width", [(3, 3), (4, 9), (6, 8), (7, 12)])
def test_pooling_is_the_largest_of_nine(height, width):
    image = np.random.default_rng(4).standard_normal((2, height, width)).astype(np.float32)
    image[1, 2, 1] = np.nan
    windows = [
        [image[:, y : y + 3, x : x + 3].max(axis=(1, 2)) for x in range(0, width - 2, 2)]
        for y in range(0, height - 2, 2)
    ]
    np.testing.assert_array_equal(module.pooled(image), np.array(windows).transpose(2, 0, 1))


def pair(height=35, width=47):
    rng = np.random.default_rng(2)
    return rng.random((3, height, width)), rng.random((3, height, width))


@pytest.mark.data
def test_published_values():
    from PIL import Image

    folder = data_folder("lpips_alex")
    weights = load_lpips_weights(folder / "lpips_alex_v0_1.npz")
    read = lambda name: np.asarray(Image.open(folder / name).convert("RGB")).transpose(2, 0, 1) / 255
    reference, first, second = (read(f"ex_{name}.png") for name in ("ref", "p0", "p1"))
    assert lpips(reference, first, weights, "minus_one_one") == pytest.approx(0.721881, abs=1e-6)
    assert lpips(reference, second, weights, "minus_one_one") == pytest.approx(0.137566, abs=1e-6)
    taps = [0.018132, 0.286968, 0.159858, 0.119004, 0.137919]
    assert layer_distances(reference, first, weights, "minus_one_one") == pytest.approx(taps, abs=1e-6)
    assert lpips(reference, first, weights) == pytest.approx(0.725337, abs=1e-5)  # inputs left in [0, 1]


def test_equals_the_oracle(weights_file):
    weights = load_lpips_weights(weights_file)
    a, b = pair()
    for name, scale in (("zero_one", lambda x: x), ("minus_one_one", lambda x: 2 * x - 1)):
        assert lpips(a, b, weights, name) == pytest.approx(oracle.lpips(scale(a), scale(b), made_up_arrays()), rel=1e-5)


def test_symmetric_zero_for_equal_images_and_nan_not_hidden(weights_file):
    weights = load_lpips_weights(weights_file)
    a, b = pair()
    assert lpips(a, b, weights) == lpips(b, a, weights) > 0
    assert lpips(a, a.copy(), weights) == 0.0
    assert lpips(np.zeros_like(a), np.zeros_like(a), weights) == 0.0
    assert np.isnan(lpips(np.full_like(a, np.nan), b, weights))


def test_smallest_image(weights_file):
    weights = load_lpips_weights(weights_file)
    assert lpips(*pair(31, 31), weights) > 0
    assert lpips_obstacle(weights, 31, 31) is None
    assert lpips(*pair(30, 64), weights) is None
    assert "64 x 30 are too small" in lpips_obstacle(weights, 30, 64)


def test_without_weights_there_is_a_reason_and_no_number(no_weights_anywhere):
    assert load_lpips_weights() is None
    assert lpips(*pair(), None) is None
    reason = lpips_obstacle(None, 512, 640)
    assert "ENDOTSR_LPIPS" in reason
    assert str(no_weights_anywhere) in reason


def test_lookup_order(no_weights_anywhere, weights_file, monkeypatch, tmp_path):
    no_weights_anywhere.parent.mkdir()
    no_weights_anywhere.write_bytes(weights_file.read_bytes())
    assert load_lpips_weights() is not None
    monkeypatch.setenv("ENDOTSR_LPIPS", str(tmp_path / "of_the_environment.npz"))
    with pytest.raises(InputError, match="of_the_environment"):
        load_lpips_weights()
    assert load_lpips_weights(weights_file) is not None


@pytest.mark.parametrize(
    "key, change, text",
    [
        ("lin3_weight", None, "lin3_weight is missing"),
        ("conv2_weight", lambda a: a.transpose(1, 0, 2, 3), r"conv2_weight is float32 \(64, 192, 5, 5\)"),
        ("lin1_weight", lambda a: a.reshape(1, -1, 1, 1), "lin1_weight"),
        ("conv1_bias", lambda a: np.full_like(a, np.nan), "conv1_bias has values that are not finite"),
        ("scale", lambda a: a.astype(int), "scale is int64"),
    ],
)
def test_bad_weights_name_file_and_key(tmp_path, key, change, text):
    arrays = made_up_arrays()
    if change is None:
        del arrays[key]
    else:
        arrays[key] = change(arrays[key])
    path = tmp_path / "bad.npz"
    np.savez(path, **arrays)
    with pytest.raises(InputError, match=rf"bad\.npz.*{text}"):
        load_lpips_weights(path)


@pytest.mark.parametrize("content", [b"", b"not a zip file", b"PK\x03\x04 cut short", "one array alone", "a pickle"])
def test_unreadable_files(tmp_path, content):
    path = tmp_path / "broken.npz"
    if isinstance(content, bytes):
        path.write_bytes(content)
    elif content == "a pickle":
        np.savez(path, conv1_weight=np.array([{}], dtype=object))
    else:
        with path.open("wb") as file:
            np.save(file, np.zeros(3))
    with pytest.raises(InputError, match=r"broken\.npz"):
        load_lpips_weights(path)


def test_refuses_shapes_and_ranges(weights_file):
    weights = load_lpips_weights(weights_file)
    a, b = pair()
    with pytest.raises(ValueError, match="3, H, W"):
        lpips(a.transpose(1, 2, 0), b.transpose(1, 2, 0), weights)
    with pytest.raises(ValueError, match="zero_one or minus_one_one"):
        lpips(a, b, weights, "unit")  # type: ignore[arg-type]
