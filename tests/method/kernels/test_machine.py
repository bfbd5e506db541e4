"""The memory limit of a container, in both versions of control groups."""

import pytest

from endotsr.method.kernels import machine


@pytest.fixture
def groups(tmp_path, monkeypatch):
    """Writes limits and the groups of this process; the real ones do not count."""

    def write(process: str, limits: dict[str, str]) -> None:
        (tmp_path / "cgroup").write_text(process)
        for name, text in limits.items():
            (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
            (tmp_path / name).write_text(text)

    monkeypatch.setattr(machine, "CGROUP_OF_PROCESS", str(tmp_path / "cgroup"))
    places = {"": (str(tmp_path / "v2"), "memory.max"), "memory": (str(tmp_path / "v1"), "memory.limit_in_bytes")}
    monkeypatch.setattr(machine, "CGROUPS", places)
    return write


@pytest.mark.parametrize(("process", "limits", "expected"), [
    ("0::/\n", {"v2/memory.max": "max\n"}, None),
    ("0::/a/b\n", {"v2/a/b/memory.max": "max\n", "v2/a/memory.max": "3000000000\n"}, 3_000_000_000),
    ("4:memory:/job\n0::/\n", {"v1/job/memory.limit_in_bytes": "2000000000\n"}, 2_000_000_000),
    ("4:memory:/job\n", {"v1/job/memory.limit_in_bytes": "9223372036854771712\n"}, None),
    ("3:cpuset:/job\nnonsense\n", {}, None),
])  # fmt: skip
def test_the_least_limit_of_the_groups_of_this_process_counts(process, limits, expected, groups):
    groups(process, limits)
    assert machine.container_limit() == expected


def test_memory_is_at_most_the_limit(groups):
    groups("0::/\n", {"v2/memory.max": "123456789\n"})
    assert machine.memory_of_machine() == machine.memory_available() == 123456789


def test_without_control_groups_there_is_no_limit(monkeypatch):
    monkeypatch.setattr(machine, "CGROUPS", {"": ("/nowhere", "memory.max")})
    monkeypatch.setattr(machine, "CGROUP_OF_PROCESS", "/nowhere/cgroup")
    assert machine.container_limit() is None
