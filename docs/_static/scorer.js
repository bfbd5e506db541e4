// Order of the search results: chapters, guides and the specification before pages of names and of sources.
var Scorer = {
  score: ([page, title, anchor, description, score]) =>
    score + (/^(notebooks|guides|specification)\//.test(page) ? 12 : /^(api|_modules)\//.test(page) ? -12 : 0),
  // The rest as in Sphinx.
  objNameMatch: 11, objPartialMatch: 6, objPrio: {0: 15, 1: 5, 2: -5}, objPrioDefault: 0,
  title: 15, partialTitle: 7, term: 5, partialTerm: 2,
};
