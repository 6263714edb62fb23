import { cleared, drawFigure } from "./body.js";

// Plays a run: the body from its right, true and magnified, beside its outputs, and linked to the figures of its case.
(() => {
  "use strict";
  const COLOURS = ["#0072b2", "#d55e00", "#007a55", "#cc79a7", "#8a6d00", "#56b4e9"];
  const WIDE = 1000, HIGH = 220, SECONDS = 10;
  const source = document.getElementById("motions");
  if (!source) return;
  const motions = JSON.parse(source.textContent);

  function make(tag, name, parent, words) {
    const element = document.createElement(tag);
    element.className = name;
    if (words !== undefined) element.textContent = words;
    parent.append(element);
    return element;
  }
  function shape(tag, attributes, parent) {
    const element = document.createElementNS("http://www.w3.org/2000/svg", tag);
    for (const [name, value] of Object.entries(attributes)) element.setAttribute(name, value);
    parent.append(element);
    return element;
  }
  const within = (value, low, high) => Math.min(Math.max(value, low), high);
  const figures = (value) => (Math.abs(value) >= 100 ? value.toFixed(0) : Math.abs(value) >= 10 ? value.toFixed(1) :
    Math.abs(value) >= 0.1 || value === 0 ? value.toFixed(2) : value.toPrecision(2)).replace("-", "−");

  // whole numbers out of letters: five bits in each, lowest first, and 32 where more follow; the lowest of all is the sign
  const LETTERS = "0123456789ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz-_";
  const DIGITS = Object.fromEntries([...LETTERS].map((letter, digit) => [letter, digit]));
  function numbers(letters) {
    const found = [];
    let bits = 0, place = 0;
    for (const letter of letters) {
      const digit = DIGITS[letter];
      bits |= (digit & 31) << place;
      place += 5;
      if (digit > 31) continue;
      found.push(bits & 1 ? ~(bits >> 1) : bits >> 1);
      bits = place = 0;
    }
    return found;
  }

  // a run: its columns as numbers, and any of them at any time
  class Motion {
    constructor(data) {
      Object.assign(this, data);
      const count = numbers(data.columns[0][2]).length;
      this.columns = data.columns.map(([low, step, letters]) => {
        const values = new Float64Array(count).fill(low);
        let whole = 0, change = 0;
        if (letters) numbers(letters).forEach((second, i) => (values[i] += step * (whole += change += second)));
        return values;
      });
      const n = data.outputs.length;
      this.t = this.columns[0];
      [this.first, this.last] = [this.t[0], this.t[count - 1]];
      this.y = this.columns.slice(1, n + 1);
      this.v = this.columns.slice(n + 1, 2 * n + 1);
      this.poses = this.columns.slice(2 * n + 1);
    }
    row(time) { // of the last frame that is not later
      let [low, high] = [0, this.t.length - 1];
      while (high - low > 1) {
        const middle = (low + high) >> 1;
        if (this.t[middle] <= time) low = middle; else high = middle;
      }
      return low;
    }
    at(column, time, i = this.row(time)) {
      const share = within((time - this.t[i]) / (this.t[i + 1] - this.t[i] || 1), 0, 1);
      return column[i] + share * (column[i + 1] - column[i]);
    }
    event(time) {
      return this.events.filter((event) => event <= time).pop();
    }
  }

  function drawBody(canvas, motion, time) {
    const [pen, wide, high] = cleared(canvas), body = motion.body, i = motion.row(time), ink = getComputedStyle(canvas).color;
    const scale = Math.min((high - 30) / (1.1 * body.height), wide / (1.16 * body.height)), ground = high - 20;
    const width = 6 * body.parts + 2;
    [["true sway", 0.25], [`sway × ${body.magnification}`, 0.75]].forEach(([words, share], figure) => {
      const value = (k) => motion.at(motion.poses[figure * width + k], time, i);
      const stand = { x: share * wide - scale * body.middle, y: ground + scale * body.floor, scale };
      pen.save();
      pen.beginPath();
      pen.rect((figure * wide) / 2, 0, wide / 2, high);
      pen.clip();
      pen.strokeStyle = pen.fillStyle = ink;
      pen.lineWidth = 1;
      pen.globalAlpha = 0.5;
      pen.beginPath();
      pen.moveTo((figure + 0.08) * wide / 2, ground + 0.5);
      pen.lineTo((figure + 0.92) * wide / 2, ground + 0.5);
      pen.stroke();
      pen.setLineDash([2, 4]);
      pen.beginPath();
      pen.moveTo(share * wide, ground);
      pen.lineTo(share * wide, ground - 1.08 * scale * body.height);
      pen.stroke();
      pen.setLineDash([]);
      pen.globalAlpha = 1;
      pen.font = "12px sans-serif";
      pen.textAlign = "center";
      pen.fillText(words, share * wide, high - 4);
      const pose = (part) => {
        const [x, z, ...turn] = [0, 1, 2, 3, 4, 5].map((k) => value(6 * part + k));
        return { at: [x, 0, z], turn };
      };
      drawFigure(pen, body, stand, pose, { mark: [value(width - 2), 0, value(width - 1)] });
      pen.restore();
    });
  }

  function told(motion, time, parent) {
    parent.replaceChildren();
    const event = motion.event(time);
    make("span", "time", parent, `t = ${time.toFixed(2)} s`);
    motion.outputs.forEach(([name, unit], k) => {
      const value = figures(motion.at(motion.y[k], time));
      make("span", "value", parent, `${name} ${value}${unit === "°" ? unit : ` ${unit}`}`).style.setProperty("--line", COLOURS[k % 6]);
    });
    if (event !== undefined) make("span", "since", parent, `last event ${(time - event).toFixed(2)} s ago`);
  }

  class Player {
    constructor(root) {
      this.motion = new Motion(motions[root.dataset.motion]);
      this.root = root;
      root.hidden = false;
      if (this.motion.body) this.canvas = make("canvas", "body", root);
      if (this.canvas) this.canvas.setAttribute("role", "img"), this.canvas.setAttribute("aria-label", `${this.motion.title}: the body in motion`);
      const side = make("div", "side", root);
      this.told = make("p", "told", side);
      this.plot = shape("svg", { viewBox: `0 0 ${WIDE} ${HIGH}`, preserveAspectRatio: "none", class: "plot" }, side);
      this.ends = make("p", "ends", side);
      const bar = make("div", "bar", side);
      this.button = make("button", "play", bar);
      this.slider = Object.assign(make("input", "scrubber", bar), { type: "range", step: "any" });
      this.slider.setAttribute("aria-label", "time");
      const spans = make("div", "spans", side), { first, last, cycle } = this.motion;
      if (cycle && cycle < last - first) this.choice(spans, "one cycle", () => this.show(last - cycle, last));
      if (last - first > SECONDS) this.choice(spans, "ten seconds", () => this.show(last - SECONDS, last));
      this.choice(spans, "whole run", () => this.show(first, last));
      make("span", "hint", spans, "drag over the curves to zoom");
      this.linked = [];
      this.button.addEventListener("click", () => this.play(!this.playing));
      this.slider.addEventListener("input", () => (this.play(false), this.go(+this.slider.value)));
      this.hover();
      spans.firstChild.click();
      this.play(false);
      new ResizeObserver(() => this.draw()).observe(root);
    }
    choice(parent, words, act) {
      Object.assign(make("button", "span", parent, words), { type: "button" }).addEventListener("click", act);
    }
    show(from, to) {
      const { first, last, t } = this.motion;
      [this.from, this.to] = [within(from, first, last), within(to, first, last)];
      if (this.to - this.from < 0.05) [this.from, this.to] = [first, last];
      Object.assign(this.slider, { min: this.from, max: this.to });
      this.curves();
      this.go(this.time === undefined ? this.from : within(this.time, this.from, this.to));
    }
    across(time) {
      return (WIDE * (time - this.from)) / (this.to - this.from);
    }
    curves() {
      const { y, t, events, outputs, row } = this.motion;
      const i = this.motion.row(this.from), j = this.motion.row(this.to) + 1, step = Math.max(1, Math.floor((j - i) / 1500));
      const alike = outputs.every(([, unit]) => unit === outputs[0][1]);
      const reach = (columns) => columns.reduce(([low, high], column) => {
        for (let k = i; k <= j; k++) [low, high] = [Math.min(low, column[k]), Math.max(high, column[k])];
        return [low, high];
      }, [Infinity, -Infinity]);
      const all = reach(y);
      this.plot.replaceChildren();
      const here = events.filter((event) => event >= this.from && event <= this.to);
      for (const event of here.length < 200 ? here : []) {
        const x = this.across(event);
        shape("line", { x1: x, x2: x, y1: 0, y2: HIGH, class: "event" }, this.plot);
      }
      y.forEach((column, output) => {
        const [low, high] = alike ? all : reach([column]), size = high - low || 1;
        const points = [];
        for (let k = i; k <= j; k += step)
          points.push(`${this.across(t[k]).toFixed(1)},${(HIGH * (0.95 - (0.9 * (column[k] - low)) / size)).toFixed(1)}`);
        shape("polyline", { points: points.join(" "), stroke: COLOURS[output % 6], class: "curve" }, this.plot);
      });
      this.cursor = shape("line", { y1: 0, y2: HIGH, class: "cursor" }, this.plot);
      const unit = outputs[0][1] === "°" ? "°" : ` ${outputs[0][1]}`;
      const range = alike ? `, ${figures(all[0])} to ${figures(all[1])}${unit}` : ", each output on its own scale";
      this.ends.textContent = `${this.from.toFixed(2)} to ${this.to.toFixed(2)} s${range}; dotted: events`;
    }
    go(time) {
      this.time = within(time, this.motion.first, this.motion.last);
      if (this.time < this.from || this.time > this.to) {
        const half = (this.to - this.from) / 2, { first, last } = this.motion;
        const middle = within(this.time, first + half, last - half);
        return this.show(middle - half, middle + half);
      }
      this.slider.value = this.time;
      this.root.dataset.time = this.time.toFixed(3);
      this.draw();
    }
    draw() {
      if (this.canvas) drawBody(this.canvas, this.motion, this.time);
      told(this.motion, this.time, this.told);
      const x = this.across(this.time);
      this.cursor.setAttribute("x1", x);
      this.cursor.setAttribute("x2", x);
      for (const mark of this.linked) mark(this.time);
    }
    play(on) {
      this.playing = on;
      this.button.textContent = on ? "❚❚" : "▶";
      this.button.setAttribute("aria-label", on ? "pause" : "play");
      if (!on) return;
      let before;
      const tick = (now) => {
        if (!this.playing) return;
        const { top, bottom } = this.root.getBoundingClientRect(), passed = before === undefined ? 0 : (now - before) / 1000;
        before = now;
        const next = this.time + Math.min(passed, 0.2);
        if (bottom > 0 && top < window.innerHeight) this.go(next < this.to ? next : this.from + ((next - this.to) % (this.to - this.from)));
        requestAnimationFrame(tick);
      };
      requestAnimationFrame(tick);
    }
    // a pointer over the curves: the body goes there; dragged with a mouse: zoom
    hover() {
      let start, box;
      const time = (event) => {
        const { left, width } = this.plot.getBoundingClientRect();
        return this.from + (this.to - this.from) * within((event.clientX - left) / width, 0, 1);
      };
      const leave = () => (box?.remove(), (start = box = undefined));
      this.plot.addEventListener("pointerdown", (event) => {
        if (event.pointerType === "mouse" && event.button === 0) start = time(event);
      });
      this.plot.addEventListener("pointermove", (event) => {
        this.play(false);
        this.go(time(event));
        if (start === undefined) return;
        box ??= shape("rect", { y: 0, height: HIGH, class: "zoom" }, this.plot);
        const [a, b] = [this.across(start), this.across(this.time)];
        box.setAttribute("x", Math.min(a, b));
        box.setAttribute("width", Math.abs(a - b));
      });
      this.plot.addEventListener("pointerleave", leave);
      this.plot.addEventListener("pointerup", (event) => {
        const [a, b] = [start, time(event)];
        leave();
        if (a !== undefined && Math.abs(this.across(a) - this.across(b)) > 15) this.show(Math.min(a, b), Math.max(a, b));
      });
      this.plot.addEventListener("dblclick", () => this.show(this.motion.first, this.motion.last));
    }
    // a figure with axes of time, or a plane of outputs against their rates
    link(panel) {
      const image = panel.querySelector(".drawn"), holder = document.createElement("div");
      const axes = panel.dataset.linked.split(";").map((each) => each.split(" ")).map(([kind, ...of]) => [kind, of.map(Number)]);
      const [kind, [left, right, top, bottom, ...range]] = axes[0];
      const { motion } = this;
      holder.className = "held";
      image.replaceWith(holder);
      holder.append(image);
      const count = kind === "time" ? 1 : motion.outputs.length;
      const marks = Array.from({ length: count }, () => make("i", kind, holder));
      const span = ([a, b], value) => (value - a) / (b - a);
      // of several planes each has one output
      const plane = (k) => axes[Math.min(k, axes.length - 1)][1];
      const put = (mark, x, y, [, , above, below] = axes[0][1]) => {
        mark.hidden = !(x >= 0 && x <= 1 && y >= 0 && y <= 1);
        mark.style.left = `${100 * (left + x * (right - left))}%`;
        mark.style.top = `${100 * (kind === "time" ? top : below - y * (below - above))}%`;
      };
      if (kind === "time") marks[0].style.height = `${100 * (axes[axes.length - 1][1][3] - top)}%`;
      this.linked.push((time) => marks.forEach((mark, k) => (kind === "time" ? put(mark, span(range, time), 0) :
        put(mark, span(plane(k).slice(4), motion.at(motion.y[k], time)), span(plane(k).slice(6), motion.at(motion.v[k], time)), plane(k)))));
      const near = (across, down) => { // the time at which an output is nearest in the plane
        let best = [Infinity, this.time];
        for (let i = motion.row(Math.max(motion.first, motion.last - 2 * SECONDS)); i < motion.t.length; i++)
          for (let k = 0; k < count; k++) {
            const [, , above, below, ...limits] = plane(k), y = span([below, above], down);
            if (y < 0 || y > 1) continue;
            const away = Math.hypot(span(limits, motion.y[k][i]) - across, span(limits.slice(2), motion.v[k][i]) - y);
            if (away < best[0] - 1e-4) best = [away, motion.t[i]];
          }
        return best[1];
      };
      const move = (event) => {
        const box = image.getBoundingClientRect();
        const x = span([left, right], (event.clientX - box.left) / box.width), y = (event.clientY - box.top) / box.height;
        if (x < 0 || x > 1) return tip.hide();
        this.play(false);
        this.go(kind === "time" ? range[0] + x * (range[1] - range[0]) : near(x, y));
        tip.show(motion, this.time, event);
      };
      holder.addEventListener("pointermove", move);
      holder.addEventListener("pointerdown", move);
      holder.addEventListener("pointerleave", () => tip.hide());
      this.draw();
    }
  }

  // the body and the values beside a pointer
  const tip = {
    root: make("div", "tip", document.body),
    show(motion, time, { clientX, clientY }) {
      if (this.of !== motion) {
        this.root.replaceChildren();
        this.canvas = motion.body && make("canvas", "body", this.root);
        this.words = make("p", "told", this.root);
        this.of = motion;
      }
      this.root.style.display = "block";
      told(motion, time, this.words);
      if (this.canvas) drawBody(this.canvas, motion, time);
      const { width, height } = this.root.getBoundingClientRect();
      this.root.style.left = `${clientX + 18 + width < window.innerWidth ? clientX + 18 : Math.max(clientX - 18 - width, 0)}px`;
      this.root.style.top = `${within(clientY - height / 2, 0, Math.max(window.innerHeight - height, 0))}px`;
    },
    hide() {
      this.root.style.display = "none";
    },
  };

  for (const root of document.querySelectorAll("[data-motion]")) {
    if (!motions[root.dataset.motion]) continue;
    const player = new Player(root), figure = root.closest("figure");
    if (figure) figure.querySelectorAll("[data-linked]").forEach((panel) => player.link(panel));
    if ("opening" in root.dataset && !window.matchMedia("(prefers-reduced-motion: reduce)").matches) player.play(true);
  }
})();
