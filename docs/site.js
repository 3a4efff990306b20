// What is wider than the page scrolls in its own box: reached with Tab, and marked at each edge behind which there is more.
const kinds = [
  [".pst-scrollable-table-container, .cell_output .output.text_html", "table"],
  [".formula", "formula"],
  ["pre", "code"],
  [".drawing", "picture"],
];

function mark(box, kind) {
  const hidden = box.scrollWidth - box.clientWidth;
  const wide = hidden > 1;
  box.tabIndex = wide ? 0 : -1;
  if (wide) {
    box.setAttribute("role", "group");
    box.setAttribute("aria-label", `${kind}, wider than the page: scrolls sideways`);
  } else {
    box.removeAttribute("role");
    box.removeAttribute("aria-label");
  }
  box.parentElement.classList.toggle("more-left", wide && box.scrollLeft > 1);
  box.parentElement.classList.toggle("more-right", wide && box.scrollLeft < hidden - 1);
}

function watch() {
  for (const [selector, kind] of kinds) {
    for (const box of document.querySelectorAll(selector)) {
      if (!box.closest("main") || box.parentElement.closest(".scrolls")) continue;
      const frame = document.createElement("div");
      frame.className = "scrolls";
      box.replaceWith(frame);
      frame.append(box);
      const again = () => mark(box, kind);
      box.addEventListener("scroll", again, { passive: true });
      new ResizeObserver(again).observe(box);
      for (const picture of box.querySelectorAll("img")) picture.addEventListener("load", again);
      again();
    }
  }
}

// The theme's controls that have no name, or another than they show.
function name() {
  for (const arrow of document.querySelectorAll("summary")) {
    const page = arrow.closest("li")?.querySelector("a")?.textContent.trim();
    if (page && !arrow.textContent.trim()) arrow.setAttribute("aria-label", `pages below ${page}`);
  }
  document.querySelector(".bd-links__title")?.setAttribute("aria-level", "2"); // the page's title is the first
  for (const search of document.querySelectorAll(".search-button-field")) search.setAttribute("aria-label", search.innerText.replace(/\s+/g, " ").trim() || "Search");
}

function begin() {
  watch();
  name();
}

if (document.readyState === "loading") addEventListener("DOMContentLoaded", begin);
else begin();
