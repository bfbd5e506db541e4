"""One table in three forms: aligned text, Markdown, HTML."""

from html.parser import HTMLParser

from endotsr.report.tables import html_table, markdown, plain

COLUMNS = ("stage", "ms", "bound by")
ROWS = [["blend", "12.5", "memory"], ["iteration", "7", ""]]


def test_plain_columns_are_aligned():
    assert plain(COLUMNS, ROWS, left=(0, 2)).splitlines() == [
        "stage        ms  bound by",
        "blend      12.5  memory",
        "iteration     7",
    ]
    assert plain(COLUMNS, ROWS, rule=True).splitlines()[1] == "---------  ----  --------"
    assert plain(COLUMNS, []) == "stage  ms  bound by"


def test_markdown_has_one_rule_and_every_cell():
    assert markdown(COLUMNS, ROWS).splitlines() == [
        "| stage | ms | bound by |",
        "|---|---|---|",
        "| blend | 12.5 | memory |",
        "| iteration | 7 |  |",
    ]


def test_html_escapes_heads_and_keeps_cells():
    found: list[tuple[str, dict[str, str | None]]] = []

    class Reader(HTMLParser):
        def handle_starttag(self, tag, attrs):
            found.append((tag, dict(attrs)))

    text = html_table(["a<b", "n"], [["<b>x</b>", "1"], ["y", "2"]], ["best"], caption="c&d")
    Reader().feed(text)
    assert "a&lt;b" in text and "c&amp;d" in text and "<b>x</b>" in text
    rows = [attributes for tag, attributes in found if tag == "tr"]
    assert rows == [{}, {"class": "best"}, {}]
    assert [attributes["scope"] for tag, attributes in found if tag == "th"] == ["col", "col", "row", "row"]
