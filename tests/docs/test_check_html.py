"""The checker of the built book finds what it is made for."""

from check_html import problems

GOOD = '<h1 id="top">A</h1><a href="b.html#there">b</a><span class="math">\\frac12</span><pre>\\frac</pre>'


def book(folder, a, b='<p id="there">b</p>'):
    (folder / "a.html").write_text(a, encoding="utf-8")
    (folder / "b.html").write_text(b, encoding="utf-8")
    return problems(folder)


def test_broken_links_and_anchors_are_found(tmp_path):
    found = book(tmp_path, '<a href="c.html">x</a><a href="b.html#gone">x</a><a href="#gone">x</a>')
    assert [line.rsplit(": ", 1)[1] for line in found] == ["no such file", "no such anchor", "no such anchor"]


def test_raw_markup_is_found(tmp_path):
    assert len(book(tmp_path, "<p>see \\frac12</p><p>{eq}`eq-4`</p>")) == 2


def test_what_is_loaded_from_the_network_is_found_and_a_good_page_passes(tmp_path):
    assert "network" in book(tmp_path, '<script src="https://cdn.example/x.js"></script>')[0]
    assert book(tmp_path, GOOD + '<a href="https://example.org/paper">x</a>') == []
