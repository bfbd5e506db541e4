"""One table in three forms: aligned text, Markdown, HTML."""

from html.parser import HTMLParser

from endotsr.results.report.tables import html_table, markdown, plain

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

    text = html_table(["a<b", "n"], [["<b>x</b>", "1"], ["y", "2"]], ["best"])
    Reader().feed(text)
    assert "a&lt;b" in text and "<b>x</b>" in text
    rows = [attributes for tag, attributes in found if tag == "tr"]
    assert rows == [{}, {"class": "best"}, {}]
    assert [attributes["scope"] for tag, attributes in found if tag == "th"] == ["col", "col", "row", "row"]


def test_units_and_sentences_in_html():
    text = html_table(["name", "PSNR, dB", "why"], [["x", "1", "<b>a sentence</b> that is too long for one line"]])
    assert (
        "PSNR,\u00a0dB" in text
        and '<td class="words" data-head="why"><b>' in text
        and '<td data-head="PSNR, dB">1</td>' in text
    )
    assert '<th scope="col" class=words>why</th>' in text and '<th scope="col">name</th>' in text


def test_few_columns_stand_below_the_name_of_their_row_on_a_telephone():
    few, many = (html_table([str(k) for k in range(n)], [["x"] * n]) for n in (7, 8))
    assert f'class="scroll few" style="--columns:{" ".join(["minmax(0,18fr)"] * 6)}"' in few
    assert 'class="scroll"' in many


def test_columns_whose_words_do_not_fit_side_by_side_stand_one_below_the_other_on_a_telephone():
    rows = [["x", "0.123456", "a threshold"], ["y", "1", ""]]
    assert "scroll few" in html_table(["a", "b", "c"], rows)
    assert 'class="scroll listed"' in html_table(["a", "b", "c"], [["x", "1", "a" * 44]])
    assert 'class="scroll listed"' in html_table(
        ["a", "b", "c"], [["x", "1", "a sentence of more words than a line has"]]
    )
    assert 'class="scroll listed"' in html_table(["a", "b" * 46, "c"], rows)
