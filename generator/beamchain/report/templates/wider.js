// Says of tables and figures that are wider than the page that they scroll; the keyboard scrolls them too.
(() => {
  const look = () => {
    for (const e of document.querySelectorAll(".scroll")) {
      const wider = e.scrollWidth > e.clientWidth + 1;
      e.classList.toggle("wider", wider);
      if (wider) e.setAttribute("tabindex", "0"); else e.removeAttribute("tabindex");
    }
  };
  look();
  window.addEventListener("resize", look);
  document.addEventListener("toggle", look, true);
})();
// what is folded is printed as well
addEventListener("beforeprint", () => document.querySelectorAll("details").forEach((part) => { part.open = true; }));
