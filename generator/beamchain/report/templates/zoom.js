"use strict";
// Zooms the plots of this page: it moves the points of the drawn curves and writes new ticks, nothing is fetched.
(() => {
  const NS = "http://www.w3.org/2000/svg";
  const make = (name, attributes, parent) => {
    const element = document.createElementNS(NS, name);
    for (const [key, value] of Object.entries(attributes)) element.setAttribute(key, value);
    if (parent) parent.append(element);
    return element;
  };
  const superscript = (n) => String(n).replace(/./g, (c) => "⁰¹²³⁴⁵⁶⁷⁸⁹"[c] || "⁻");
  const label = (v) => {
    if (v === 0) return "0";
    const e = Math.floor(Math.log10(Math.abs(v)) + 1e-9);
    if (e >= -4 && e < 5) return String(+v.toPrecision(6));
    const m = +(v / 10 ** e).toPrecision(5);
    return (m === 1 ? "" : m + "·") + "10" + superscript(e);
  };
  // round numbers in an interval: powers of ten, then 1 2 5, then even steps
  const ticks = (low, high, log) => {
    const out = [];
    const decades = log ? Math.log10(high / low) : 0;
    if (decades > 2.2) {
      const every = Math.ceil(decades / 8);
      for (let e = Math.ceil(Math.log10(low)); 10 ** e <= high; e += every) out.push(10 ** e);
    } else if (decades > 0.7) {
      for (let e = Math.floor(Math.log10(low)); 10 ** e <= high; e++)
        for (const m of [1, 2, 5]) if (m * 10 ** e >= low && m * 10 ** e <= high) out.push(m * 10 ** e);
    } else {
      const rough = (high - low) / 5;
      const power = 10 ** Math.floor(Math.log10(rough));
      const step = power * [1, 2, 5, 10].find((m) => m * power >= rough);
      for (let k = Math.ceil(low / step); k * step <= high; k++) out.push(k * step);
    }
    return out;
  };

  class Panel {
    constructor(told) {
      Object.assign(this, told);
      this.group = document.getElementById(told.id);
      this.up = [0, 1]; // the part of the height shown, from below
      const inAxis = (e) => e.closest('[id*="matplotlib.axis_"]');
      this.curves = [...this.group.querySelectorAll("path[clip-path]")].filter((e) => !inAxis(e))
        .map((path) => ({ path, d: path.getAttribute("d").match(/[A-Za-z]|-?[\d.]+(?:e-?\d+)?/g) }));
      this.marks = [...this.group.querySelectorAll("use")].filter((e) => !inAxis(e))
        .map((e) => ({ e, x: +e.getAttribute("x"), y: +e.getAttribute("y") }));
      this.notes = [...this.group.querySelectorAll('[id$="-follows"]')];
      this.old = [...this.group.querySelectorAll('[id*="xtick_"], [id*="ytick_"]')];
      const inHz = (e) => e.closest('[id*="-hz"]') !== null;
      const text = (axis, hz) =>
        [...this.group.querySelectorAll(`[id*="${axis}tick_"] text`)].find((e) => inHz(e) === hz);
      this.text = { x: text("x", false), y: text("y", false), hz: text("x", true) };
      const first = this.curves.length ? this.curves[0].path.parentNode : null;
      this.fresh = document.createElementNS(NS, "g");
      this.group.insertBefore(this.fresh, first);
    }
    place(x, y, across) {
      const [left, top, width, height] = this.box;
      const u = ((x - left) / width - across[0]) / (across[1] - across[0]);
      const v = ((top + height - y) / height - this.up[0]) / (this.up[1] - this.up[0]);
      return [left + u * width, top + height - v * height];
    }
    limits(which, part) {
      const [low, high] = this[which];
      const log = which === "x" || this.log;
      return part.map((f) => (log ? low * (high / low) ** f : low + (high - low) * f));
    }
    draw(across) {
      for (const { path, d } of this.curves) {
        let out = "";
        for (let i = 0; i < d.length; i++) {
          if (/[A-Za-z]/.test(d[i])) { out += d[i]; continue; }
          const [x, y] = this.place(+d[i], +d[++i], across);
          out += x.toFixed(2) + " " + y.toFixed(2) + " ";
        }
        path.setAttribute("d", out);
      }
      const [left, top, width, height] = this.box;
      for (const { e, x, y } of this.marks) {
        const onEdge = Math.abs(y - top) < 0.5 || Math.abs(y - top - height) < 0.5;
        const [u, v] = this.place(x, y, across);
        e.setAttribute("x", u);
        e.setAttribute("y", onEdge ? y : v);
        const seen = u >= left - 0.1 && u <= left + width + 0.1 && (onEdge || (v >= top && v <= top + height));
        e.setAttribute("visibility", seen ? "visible" : "hidden");
        for (const note of onEdge ? [] : this.notes) {
          note.setAttribute("transform", `translate(${u - x} ${v - y})`);
          note.setAttribute("visibility", seen ? "visible" : "hidden");
        }
      }
      this.write(across);
    }
    write(across) {
      const whole = across[0] === 0 && across[1] === 1 && this.up[0] === 0 && this.up[1] === 1;
      for (const e of this.old) e.setAttribute("visibility", whole ? "visible" : "hidden");
      this.fresh.replaceChildren();
      if (whole) return;
      const [left, top, width, height] = this.box;
      const line = (points) => {
        make("polyline", { points, fill: "none", stroke: "#e3e3e3", "stroke-width": 0.6 }, this.fresh);
      };
      const word = (like, x, y, text) => {
        if (!like) return;
        make("text", { x, y, style: like.getAttribute("style") }, this.fresh).textContent = text;
      };
      const [x0, x1] = this.limits("x", across);
      for (const v of ticks(x0, x1, true)) {
        const x = left + (width * Math.log(v / x0)) / Math.log(x1 / x0);
        line(`${x},${top} ${x},${top + height + 3}`);
        word(this.text.x, x, this.text.x && this.text.x.getAttribute("y"), label(v));
      }
      const turn = 2 * Math.PI;
      for (const f of this.text.hz ? ticks(x0 / turn, x1 / turn, true) : []) {
        const x = left + (width * Math.log((f * turn) / x0)) / Math.log(x1 / x0);
        make("path", { d: `M${x} ${top}v-3.5`, stroke: "#000", "stroke-width": 0.8 }, this.fresh);
        word(this.text.hz, x, this.text.hz.getAttribute("y"), label(f));
      }
      const [y0, y1] = this.limits("y", this.up);
      const marks = this.log ? ticks(y0, y1, true) : [0, 180].filter((v) => v >= y0 && v <= y1);
      for (const v of marks) {
        const f = this.log ? Math.log(v / y0) / Math.log(y1 / y0) : (v - y0) / (y1 - y0);
        const y = top + height * (1 - f);
        line(`${left - 3},${y} ${left + width},${y}`);
        word(this.text.y, this.text.y && this.text.y.getAttribute("x"), y + 3.6, label(v));
      }
    }
  }

  const within = ([a, b]) => {
    const size = Math.min(Math.max(b - a, 0.002), 1);
    const low = Math.min(Math.max(a, 0), 1 - size);
    return [low, low + size];
  };
  const about = ([a, b], at, factor) => within([at - (at - a) / factor, at + (b - at) / factor]);

  const start = (figure) => {
    const svg = figure.querySelector("svg[data-plot]");
    if (!svg) return;
    const panels = JSON.parse(svg.dataset.plot).map((told) => new Panel(told));
    let across = [0, 1];
    let waiting = false;
    const bar = document.createElement("div");
    bar.className = "bar";
    const told = document.createElement("span");
    told.setAttribute("role", "status");
    const show = () => {
      if (waiting) return;
      waiting = true;
      requestAnimationFrame(() => {
        waiting = false;
        for (const panel of panels) panel.draw(across);
        const [a, b] = panels[0].limits("x", across);
        const whole = across[0] === 0 && across[1] === 1;
        told.textContent = whole ? "" : `${+a.toPrecision(3)} to ${+b.toPrecision(3)}`;
        svg.dataset.shown = JSON.stringify(across);
      });
    };
    const middle = ([a, b]) => (a + b) / 2;
    const shift = (part, by) => within([part[0] + by * (part[1] - part[0]), part[1] + by * (part[1] - part[0])]);
    const deeds = {
      "+": () => { across = about(across, middle(across), 1.6); },
      "-": () => { across = about(across, middle(across), 1 / 1.6); },
      ArrowLeft: () => { across = shift(across, -0.2); },
      ArrowRight: () => { across = shift(across, 0.2); },
      ArrowUp: () => { for (const p of panels) if (p.log) p.up = shift(p.up, 0.2); },
      ArrowDown: () => { for (const p of panels) if (p.log) p.up = shift(p.up, -0.2); },
      "*": () => { for (const p of panels) if (p.log) p.up = about(p.up, middle(p.up), 1.6); },
      "/": () => { for (const p of panels) if (p.log) p.up = about(p.up, middle(p.up), 1 / 1.6); },
      0: () => { across = [0, 1]; for (const p of panels) p.up = [0, 1]; },
    };
    deeds["="] = deeds["+"];
    const buttons = [["+", "+", "zoom in"], ["-", "−", "zoom out"], ["ArrowLeft", "←", "to the left"],
      ["ArrowRight", "→", "to the right"], ["*", "↕+", "stretch upwards"], ["/", "↕−", "shrink upwards"], ["0", "all", "show all"]];
    for (const [key, text, title] of buttons) {
      const button = document.createElement("button");
      button.type = "button";
      button.textContent = text;
      button.title = title;
      button.setAttribute("aria-label", `${title}: ${svg.getAttribute("aria-label")}`);
      button.addEventListener("click", () => { deeds[key](); show(); });
      bar.append(button);
    }
    bar.append(told);
    svg.parentNode.before(bar);
    svg.setAttribute("tabindex", "0");
    svg.addEventListener("keydown", (event) => {
      if (!deeds[event.key] || event.ctrlKey || event.metaKey || event.altKey) return;
      event.preventDefault();
      deeds[event.key]();
      show();
    });
    const spot = (event) => { // in the picture's own units, and the panel there
      const at = new DOMPoint(event.clientX, event.clientY).matrixTransform(svg.getScreenCTM().inverse());
      const panel = panels.find(({ box: [l, t, w, h] }) => at.x >= l && at.x <= l + w && at.y >= t && at.y <= t + h);
      return { at, panel };
    };
    const part = ({ box: [l, t, w, h], up }, { x, y }) => {
      const u = Math.min(Math.max((x - l) / w, 0), 1), v = Math.min(Math.max((t + h - y) / h, 0), 1);
      return [across[0] + u * (across[1] - across[0]), up[0] + v * (up[1] - up[0])];
    };
    svg.addEventListener("wheel", (event) => {
      const { at, panel } = spot(event);
      if (!panel || !event.ctrlKey) return;
      event.preventDefault();
      const factor = Math.exp(-event.deltaY / 400);
      const [u, v] = part(panel, at);
      across = about(across, u, factor);
      if (panel.log) panel.up = about(panel.up, v, factor);
      show();
    }, { passive: false });
    let from = null, frame = null;
    svg.addEventListener("pointerdown", (event) => {
      const { at, panel } = spot(event);
      if (!panel || event.button !== 0 || event.pointerType === "touch") return;
      event.preventDefault();
      svg.focus({ preventScroll: true });
      svg.setPointerCapture(event.pointerId);
      from = { at, panel, across, up: panel.up, pan: event.shiftKey };
      if (!from.pan) frame = make("rect", { fill: "#0a5fb4", "fill-opacity": 0.12, stroke: "#0a5fb4", "stroke-width": 0.8 }, svg);
    });
    svg.addEventListener("pointermove", (event) => {
      if (!from) return;
      const { at } = spot(event);
      const { panel } = from;
      const [l, t, w, h] = panel.box;
      if (from.pan) {
        const size = from.across[1] - from.across[0], tall = from.up[1] - from.up[0];
        const du = ((from.at.x - at.x) / w) * size, dv = ((at.y - from.at.y) / h) * tall;
        across = within([from.across[0] + du, from.across[1] + du]);
        if (panel.log) panel.up = within([from.up[0] + dv, from.up[1] + dv]);
        show();
        return;
      }
      const x = [from.at.x, at.x].map((v) => Math.min(Math.max(v, l), l + w)).sort((p, q) => p - q);
      const y = panel.log ? [from.at.y, at.y].map((v) => Math.min(Math.max(v, t), t + h)).sort((p, q) => p - q) : [t, t + h];
      for (const [key, value] of Object.entries({ x: x[0], y: y[0], width: x[1] - x[0], height: y[1] - y[0] })) frame.setAttribute(key, value);
    });
    const end = (event) => {
      if (!from) return;
      const { at } = spot(event);
      const { panel, pan } = from;
      if (frame) frame.remove();
      if (!pan && event.type === "pointerup" && Math.abs(at.x - from.at.x) > 4) {
        const one = part(panel, from.at), two = part(panel, at);
        if (panel.log && Math.abs(at.y - from.at.y) > 4) panel.up = within([Math.min(one[1], two[1]), Math.max(one[1], two[1])]);
        across = within([Math.min(one[0], two[0]), Math.max(one[0], two[0])]);
        show();
      }
      from = frame = null;
    };
    svg.addEventListener("pointerup", end);
    svg.addEventListener("pointercancel", end);
    svg.addEventListener("dblclick", () => { deeds[0](); show(); });
    figure.classList.add("ready");
  };
  document.querySelectorAll("figure.zoom").forEach(start);
})();
