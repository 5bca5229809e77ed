// Order of the results: a page by its title first, then terms of the glossary, then sections, then texts; texts of the
// reference and of the project last. Sphinx calls it for each: [docname, title, anchor, descr, score, filename, kind].
"use strict";
var Scorer = {
  objNameMatch: 11, objPartialMatch: 6, objPrio: { 0: 15, 1: 5, 2: -5 }, objPrioDefault: 0,
  title: 15, partialTitle: 7, term: 5, partialTerm: 2,
  score: item => {
    const [page, title, , , score, , kind] = item;
    const words = text => text.toLowerCase().match(/[\p{L}\d_]+/gu) || [];
    const asked = words(new URLSearchParams(location.search).get("q") || ""), own = words(title.split(" > ").pop());
    const held = asked.filter(word => own.includes(word)).length / (asked.length || 1);
    const named = held === 1 ? 60 + Math.round((40 * asked.length) / own.length) : Math.round(30 * held);
    if (kind === "index") {
      const entry = Object.entries(Search._index.indexentries).find(([, places]) =>
        places.some(([file, id]) => Search._index.docnames[file] === page && `#${id}` === item[2]));
      if (page === "glossary" && entry) item[1] = `${title}: ${entry[0]}`;
      return score >= 100 ? 180 : score;
    }
    const whole = !title.includes(" > ") && !item[2];
    const aside = /^(reference|units)\/|^(changelog|contributing|architecture|security|style|renamed|index)$/.test(page);
    return score + named + (whole && held === 1 ? 90 : 0) - (aside ? 25 : 0);
  },
};
