from pathlib import Path

from robotcast.files import source_digest


def test_changed_code_has_another_digest_and_other_files_do_not_count(tmp_path: Path) -> None:
    for name in ("physics", "page"):
        (tmp_path / name).mkdir()
    module, seen = tmp_path / "physics" / "drag.py", []
    for text in ("c = 1", "c = 2"):
        module.write_text(text)
        seen.append(source_digest("physics", root=tmp_path))
    (tmp_path / "page" / "html.py").write_text("h = 1")
    (tmp_path / "physics" / "drag.pyc").write_text("compiled")
    assert source_digest("physics", root=tmp_path) == seen[-1]
    module.rename(module.with_name("wind.py"))
    assert len({*seen, source_digest("physics", root=tmp_path)}) == 3
    assert source_digest("simulators") != source_digest("effects")
