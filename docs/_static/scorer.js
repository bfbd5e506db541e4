// Order of the search results: chapters, guides and the specification before pages of names and of sources, and pages
// with the words of the query in their titles before others.
var Scorer = {
  score: ([page, title, anchor, description, score]) => {
    const query = (new URLSearchParams(window.location.search).get("q") || "").toLowerCase().split(/\s+/);
    const named = query.filter((word) => word.length > 2 && title.toLowerCase().includes(word)).length;
    const kind = [[/^notebooks\//, 14], [/^(guides|specification)\//, 12], [/^(api|_modules)\//, -12]];
    return score + 6 * named + kind.reduce((sum, [pages, bonus]) => sum + (pages.test(page) ? bonus : 0), 0);
  },
  // The rest as in Sphinx.
  objNameMatch: 11, objPartialMatch: 6, objPrio: {0: 15, 1: 5, 2: -5}, objPrioDefault: 0,
  title: 15, partialTitle: 7, term: 5, partialTerm: 2,
};
