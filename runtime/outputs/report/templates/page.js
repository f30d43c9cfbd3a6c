"use strict";
// Tables sorted by their headers, figures that zoom, a filter of methods; all of it optional.
(() => {
  const make = (tag, attributes, text = "") => {
    const element = Object.assign(document.createElement(tag), attributes);
    element.textContent = text;
    return element;
  };
  const all = (selector, root = document) => [...root.querySelectorAll(selector)];

  // --- tables: up, down, as it was -----------------------------------------------------------
  const NUMBER = /^[≤≈<]?([-+]?(?:\d+\.?\d*|\.\d+)(?:e[-+]?\d+)?)/i;
  const valueOf = (text) => {
    const bare = text.replace(/\s/g, "").replace("−", "-");
    if (bare.startsWith("∞")) return Infinity;
    const found = bare.match(NUMBER);
    return found ? Number(found[1]) : NaN;
  };
  const sort = (table, head, column) => {
    const next = { none: "ascending", ascending: "descending", descending: "none" };
    const order = next[head.getAttribute("aria-sort") ?? "none"];
    for (const other of all("th[aria-sort]", table)) other.setAttribute("aria-sort", "none");
    head.setAttribute("aria-sort", order);
    const body = table.tBodies[0];
    const sign = order === "descending" ? -1 : 1;
    const keyed = [...body.rows].map((row) => {
      const text = row.cells[column]?.textContent.trim() ?? "";
      return { row, text, value: valueOf(text), place: Number(row.dataset.place) };
    });
    const told = keyed.filter((k) => !["", "–"].includes(k.text));
    const numeric = told.every((k) => !Number.isNaN(k.value));
    const missing = (k) => (["", "–"].includes(k.text) ? 1 : 0);
    keyed.sort((a, b) => {
      if (order === "none") return a.place - b.place;
      const apart = missing(a) - missing(b);
      if (apart || missing(a)) return apart || a.place - b.place;
      const by = numeric
        ? (a.value > b.value) - (a.value < b.value)
        : a.text.localeCompare(b.text, "en", { numeric: true });
      return sign * by || a.place - b.place;
    });
    body.append(...keyed.map((k) => k.row));
  };
  for (const table of all("table.numbers")) {
    [...table.tBodies[0].rows].forEach((row, k) => (row.dataset.place = k));
    [...table.tHead.rows].at(-1).querySelectorAll("th").forEach((head, column) => {
      const button = make("button", { type: "button", title: "sort" }, head.textContent);
      head.replaceChildren(button);
      head.setAttribute("aria-sort", "none");
      button.addEventListener("click", () => sort(table, head, column));
    });
  }

  // --- figures: wheel, drag, pinch, keys, double click ----------------------------------------
  const MOST = 40;
  const clamp = (x, low, high) => Math.min(Math.max(x, low), high);
  const resets = [];
  for (const box of all(".figure")) {
    const svg = box.querySelector("svg");
    const { x: X, y: Y, width: W, height: H } = svg.viewBox.baseVal;
    let [x, y, scale] = [X, Y, 1];
    const show = () => {
      x = clamp(x, X, X + W - W / scale);
      y = clamp(y, Y, Y + H - H / scale);
      svg.setAttribute("viewBox", [x, y, W / scale, H / scale].map((v) => v.toFixed(3)).join(" "));
      box.classList.toggle("zoomed", scale > 1.001);
    };
    const zoom = (factor, u = 0.5, v = 0.5) => {
      const wanted = clamp(scale * factor, 1, MOST);
      x += u * (W / scale - W / wanted);
      y += v * (H / scale - H / wanted);
      scale = wanted;
      show();
    };
    const pan = (u, v) => { x -= (u * W) / scale; y -= (v * H) / scale; show(); };
    const reset = () => { [x, y, scale] = [X, Y, 1]; show(); };
    resets.push(reset);
    const place = (event) => {
      const r = svg.getBoundingClientRect();
      return [(event.clientX - r.left) / r.width, (event.clientY - r.top) / r.height];
    };

    const held = new Map();
    svg.addEventListener("pointerdown", (event) => {
      held.set(event.pointerId, place(event));
      box.focus({ preventScroll: true });
      if (scale > 1 || held.size > 1) svg.setPointerCapture(event.pointerId);
    });
    svg.addEventListener("pointermove", (event) => {
      const before = held.get(event.pointerId);
      if (!before) return;
      const now = place(event);
      const other = [...held].find(([id]) => id !== event.pointerId)?.[1];
      held.set(event.pointerId, now);
      if (!other) return void pan(now[0] - before[0], now[1] - before[1]);
      const far = (p) => Math.hypot(p[0] - other[0], p[1] - other[1]) || 1e-6;
      zoom(far(now) / far(before), (now[0] + other[0]) / 2, (now[1] + other[1]) / 2);
    });
    for (const end of ["pointerup", "pointercancel", "lostpointercapture"])
      svg.addEventListener(end, (event) => held.delete(event.pointerId));
    svg.addEventListener("dblclick", reset);
    svg.addEventListener("wheel", (event) => {
      if (document.activeElement !== box && !event.ctrlKey) return; // the page scrolls
      event.preventDefault();
      zoom(Math.exp(-0.0015 * event.deltaY), ...place(event));
    }, { passive: false });
    const keys = {
      "+": () => zoom(1.25), "=": () => zoom(1.25), "-": () => zoom(0.8), 0: reset, Escape: reset,
      ArrowLeft: () => pan(0.1, 0), ArrowRight: () => pan(-0.1, 0),
      ArrowUp: () => pan(0, 0.1), ArrowDown: () => pan(0, -0.1),
    };
    box.tabIndex = 0;
    box.addEventListener("keydown", (event) => {
      const arrow = event.key.startsWith("Arrow");
      if (!keys[event.key] || event.ctrlKey || (arrow && scale === 1)) return;
      event.preventDefault();
      keys[event.key]();
    });

    const tools = make("div", { className: "tools" });
    for (const [sign, label, act] of [["+", "zoom in", () => zoom(1.6)],
      ["−", "zoom out", () => zoom(0.625)], ["⟲", "whole figure", reset]]) {
      const button = make("button", { type: "button", title: label, ariaLabel: label }, sign);
      button.addEventListener("click", act);
      tools.append(button);
    }
    tools.append(make("span", {}, "click, then wheel: zoom · drag: move · double click: all"));
    box.before(tools);
  }
  addEventListener("beforeprint", () => resets.forEach((reset) => reset()));

  // --- the filter of methods -------------------------------------------------------------------
  const tagged = all("[data-m]");
  const names = [...new Set(tagged.map((element) => element.dataset.m))];
  const spans = all("th[colspan]").map((head) => {
    const before = [...head.parentNode.cells].slice(0, head.cellIndex);
    const from = before.reduce((sum, cell) => sum + cell.colSpan, 0);
    const below = [...head.closest("thead").rows].at(-1).cells;
    return { head, columns: [...below].slice(from, from + head.colSpan) };
  });
  const first = document.querySelector("section");
  if (names.length > 1 && first) {
    const filter = make("div", { className: "filter", role: "group", ariaLabel: "methods shown" });
    filter.append(make("span", { className: "soft" }, "show"));
    for (const name of names) {
      const label = make("label", {});
      const box = make("input", { type: "checkbox", checked: true, value: name });
      label.append(box, name);
      filter.append(label);
      box.addEventListener("change", () => {
        for (const element of tagged)
          if (element.dataset.m === name) element.classList.toggle("off", !box.checked);
        for (const { head, columns } of spans) {
          const left = columns.filter((cell) => !cell.classList.contains("off")).length;
          head.classList.toggle("off", left === 0);
          head.colSpan = Math.max(left, 1);
        }
      });
    }
    first.before(filter);
  }

  // --- where the reader is -----------------------------------------------------------------------
  const links = new Map(all("nav a").map((link) => [link.hash.slice(1), link]));
  const seen = new Set();
  const watch = new IntersectionObserver((entries) => {
    for (const { target, isIntersecting } of entries)
      isIntersecting ? seen.add(target) : seen.delete(target);
    const current = all("section").find((section) => seen.has(section));
    if (!current) return;
    for (const link of links.values()) link.removeAttribute("aria-current");
    links.get(current.id)?.setAttribute("aria-current", "true");
  }, { rootMargin: "-10% 0px -60% 0px" });
  all("section").forEach((section) => watch.observe(section));
})();
