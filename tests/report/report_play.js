// Plays with the page as a reader would, and says what came of it.
window.addEventListener("load", async () => {
  const wait = (ms) => new Promise((done) => setTimeout(done, ms));
  const pixels = (canvas) => canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height).data;
  const apart = (a, b) => {
    let count = 0;
    for (let i = 0; i < a.length; i += 4) if (a[i] !== b[i] || a[i + 1] !== b[i + 1] || a[i + 3] !== b[i + 3]) count++;
    return count;
  };
  const found = { faults: window.faults };
  const [opening, player] = document.querySelectorAll(".player");
  const seen = new Set();
  for (let i = 0; i < 8; i++) {
    seen.add(opening.querySelector("canvas").toDataURL());
    await wait(100);
  }
  found.played = seen.size;

  player.querySelectorAll(".spans button").forEach((button) => button.textContent === "whole run" && button.click());
  const canvas = player.querySelector("canvas"), slider = player.querySelector("input");
  const scrub = (to) => {
    slider.value = to;
    slider.dispatchEvent(new Event("input"));
    return pixels(canvas);
  };
  found.scrubbed = apart(scrub(0.2), scrub(0.7));

  // a pointer at a place of an element, parts of its width and height
  const point = (element, kind, x, y) => {
    const { left, top, width, height } = element.getBoundingClientRect();
    const at = { clientX: left + x * width, clientY: top + y * height, bubbles: true, pointerType: "mouse", button: 0 };
    element.dispatchEvent(new PointerEvent(kind, at));
  };
  const hover = (element, x, y, expected, within) => {
    const before = scrub(0.05);
    point(element, "pointermove", x, y);
    return { moved: apart(before, pixels(canvas)), time: +player.dataset.time, expected, within };
  };
  const plot = player.querySelector(".plot");
  found.curve = hover(plot, 0.25, 0.5, 0.75, 0.01);
  const figure = player.closest("figure");
  const linked = (letter) => [...figure.querySelectorAll(".panel")].find((panel) => panel.querySelector(".drawn").getAttribute("aria-label").includes(`panel (${letter})`));
  const across = (letter, part) => {
    const panel = linked(letter), [left, right, top, bottom, from, to] = panel.dataset.linked.split(";")[0].split(" ").slice(1).map(Number);
    return hover(panel.querySelector(".held"), left + part * (right - left), (top + bottom) / 2, from + part * (to - from), 0.02);
  };
  found.outputs = across("c", 0.25);
  found.told = document.querySelector(".tip").textContent;
  found.intervals = across("e", 0.3);
  found.modes = across("f", 0.5);
  // where the plane says that the body is, it is
  const panel = linked("d"), marks = panel.querySelectorAll("i.plane");
  scrub(2.9);
  const [x, y] = [parseFloat(marks[0].style.left) / 100, parseFloat(marks[0].style.top) / 100];
  found.plane = hover(panel.querySelector(".held"), x, y, 2.9, 0.15);

  point(plot, "pointerdown", 0.25, 0.5);
  point(plot, "pointermove", 0.4, 0.5);
  point(plot, "pointerup", 0.5, 0.5);
  found.zoomed = [+slider.min, +slider.max];

  found.hit = "hit" in window;
  found.text = document.body.innerText;
  const pictures = [...document.querySelectorAll("svg[role=img]")];
  found.pictures = pictures.length;
  found.broken = pictures.flatMap((one) => [...one.querySelectorAll("use")]).filter((one) => !document.querySelector(one.getAttribute("href"))).length;
  document.getElementById("found").textContent = JSON.stringify(found);
});
