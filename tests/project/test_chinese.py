"""Strategy: a Chinese page says what the English one says: section by section, all that is no prose has to be equal.

That is commands and code without comments, diagrams without labels, cells of tables by their code and numbers, code
and numbers in the text, and the targets of links. Words are for people who read both.
"""

import re
from collections import Counter
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
PAGES = ("README.md", "docs/policy_contract.md")
HEADING = re.compile(r"^(#+) .*$", re.MULTILINE)
FENCE = re.compile(r"^```(\w*)\n(.*?)^```$", re.MULTILINE | re.DOTALL)
SPAN, NUMBER, LINK = (
    re.compile(r"`([^`]+)`"),
    re.compile(r"(?<![A-Za-zπ_.\d])\d+(?:\.\d+)?"),
    re.compile(r"\]\(([^)]+)\)"),
)
COMMENT, LABEL = re.compile(r"\s*#.*$", re.MULTILINE), re.compile(r'"[^"]*"')


def chinese(page):
    return str(Path(page).with_suffix(".zh.md"))


def sections(text):
    """The level of each heading with the text below it; fenced blocks may hold lines that begin with #."""
    masked = FENCE.sub(lambda found: re.sub(r"[^\n]", " ", found[0]), text)
    starts = [(found.start(), len(found[1]), found.end()) for found in HEADING.finditer(masked)]
    ends = [start for start, _, _ in starts[1:]] + [len(text)]
    return [(level, text[begin:end]) for (_, level, begin), end in zip(starts, ends, strict=True)]


def blocks(section):
    """Fenced blocks: code without comments, diagrams without labels, others as they are."""
    dropped = {"sh": COMMENT, "python": COMMENT, "mermaid": LABEL}
    return [(kind, dropped[kind].sub("", body) if kind in dropped else body) for kind, body in FENCE.findall(section)]


def rows(section):
    """What code and numbers each cell of each table has, whatever their order; a cell of words alone has none."""
    lines = [line for line in FENCE.sub("", section).splitlines() if line.startswith("|")]
    return [[(Counter(SPAN.findall(cell)), numbers(cell)) for cell in line.split("|")[1:-1]] for line in lines]


def numbers(text):
    return Counter(NUMBER.findall(SPAN.sub("", LINK.sub("", text))))


def spans(section):
    return Counter(" ".join(span.split()) for span in SPAN.findall(FENCE.sub("", section)))


def links(section):
    """Targets of links, without the language of the page and the words of a heading."""
    targets = [target.replace(".zh.md", ".md") for target in LINK.findall(FENCE.sub("", section))]
    return Counter(re.sub(r"#.*", "#", target) for target in targets)


def differences(english, translated, page):
    """A sentence for everything in which a translation differs from the page."""
    ours, theirs = sections(english), sections(translated)
    if [level for level, _ in ours] != [level for level, _ in theirs]:
        return ["the headings are not the same"]
    found, itself = [], Counter([Path(page).name])
    for number, ((_, a), (_, b)) in enumerate(zip(ours, theirs, strict=True)):
        switch = itself if number == 0 else Counter()
        for what, of in (("code", blocks), ("cells", rows), ("code in the text", spans)):
            if of(a) != of(b):
                found.append(f"section {number}: {what}: {of(a)} is {of(b)}")
        if links(a) - switch != links(b) - switch:
            found.append(f"section {number}: links: {links(a)} is {links(b)}")
        left, right = (numbers(FENCE.sub("", text)) for text in (a, b))
        if left != right:
            found.append(f"section {number}: numbers: {left - right} is {right - left}")
    return found


@pytest.mark.parametrize("page", PAGES)
def test_a_chinese_page_has_the_commands_code_tables_and_numbers_of_the_english_one(page):
    english, translated = ((ROOT / name).read_text() for name in (page, chinese(page)))
    assert differences(english, translated, page) == [], f"bring {chinese(page)} up to {page}"
    assert len(re.findall(r"[\u4e00-\u9fff]", translated)) > 0.1 * len(english)


@pytest.mark.parametrize("page", PAGES)
def test_each_page_links_to_the_other_language(page):
    assert f"]({Path(chinese(page)).name})" in (ROOT / page).read_text()
    assert f"]({Path(page).name})" in (ROOT / chinese(page)).read_text()


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("wholebody run reach   ", "wholebody run wave   "),
        ("| numpy", "| `numpy`"),
        ("0.45 m", "0.46 m"),
        ("spec = g1()", "spec = g2()"),
        ("(docs/solvers.md)", "(docs/planner.md)"),
    ],
)
def test_a_page_that_has_drifted_is_told(old, new):
    english, translated = ((ROOT / name).read_text() for name in ("README.md", "README.zh.md"))
    assert old in translated
    assert differences(english, translated.replace(old, new, 1), "README.md")
