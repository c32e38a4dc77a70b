"""Memory of groups of processes."""

from aqualog.guard.system import _group_limits


def test_memory_of_a_control_group(tmp_path):
    (tmp_path / "a" / "b").mkdir(parents=True)
    (tmp_path / "memory" / "c").mkdir(parents=True)
    (tmp_path / "a" / "memory.max").write_text("5000\n")
    (tmp_path / "a" / "b" / "memory.max").write_text("max\n")
    (tmp_path / "memory" / "c" / "memory.limit_in_bytes").write_text("7000\n")
    groups = tmp_path / "groups"
    groups.write_text("3:cpu,memory:/c\n1:name=x:/\n0::/a/b\nnonsense\n")
    assert sorted(_group_limits(groups, tmp_path)) == [5000, 7000]
    assert _group_limits(tmp_path / "none", tmp_path) == []
