// Names and keyboard access that the theme leaves out; tests/test_docs_axe.py looks.

function name(selector, words) {
  document.querySelectorAll(selector).forEach((one) => one.setAttribute("aria-label", words));
}

// The theme puts wide tables into boxes that scroll: they can be reached and have a name.
function reach() {
  document.querySelectorAll(".md-typeset__scrollwrap, .md-typeset pre > code").forEach((one) => {
    one.setAttribute("tabindex", "0");
  });
}

document.addEventListener("DOMContentLoaded", () => {
  name(".md-search[role=dialog]", "Search");
  reach();
  new MutationObserver(reach).observe(document.body, { childList: true, subtree: true });
});
