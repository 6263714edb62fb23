// Looks at the laid-out page and tells the frame around it what it found.
(() => {
  // what is folded away is looked at unfolded
  document.querySelectorAll("details").forEach((e) => (e.open = true));
  const TEXT = "p, td, th, caption, figcaption, h1, h2, h3, h4, li, dt, dd, .matrix";
  const BLOCKS = "p, td, th, caption, figcaption, h1, h2, h3, h4, dt, dd, nav li, svg[role=img]";
  const name = (e) => `${e.tagName}.${e.getAttribute("class")} ${(e.textContent || e.getAttribute("aria-label") || "").trim().slice(0, 50)}`;
  const shown = (e) => e.getClientRects().length > 0 && e.getBoundingClientRect().width > 0;

  // on a narrow screen a large matrix and the row of contents scroll inside their own boxes; nothing else may
  function unscrolled(selector, width) {
    const inside = (e) => (e.closest(".matrix") && !e.matches(".matrix")) || e.closest("nav ol > li");
    return [...document.querySelectorAll(selector)].filter((e) => shown(e) && (width > 1000 || !inside(e)));
  }

  // WCAG 2: relative luminance, and the ratio of every text's to its ground's
  function luminance([r, g, b]) {
    const [x, y, z] = [r, g, b].map((c) => c / 255).map((c) => (c <= 0.04045 ? c / 12.92 : ((c + 0.055) / 1.055) ** 2.4));
    return 0.2126 * x + 0.7152 * y + 0.0722 * z;
  }
  const numbers = (colour) => colour.match(/[\d.]+/g).map(Number).slice(0, 3);

  function contrasts() {
    const ground = luminance(numbers(getComputedStyle(document.body).backgroundColor));
    const worst = {};
    for (const e of document.querySelectorAll("body *")) {
      if (!shown(e) || ![...e.childNodes].some((n) => n.nodeType === 3 && n.textContent.trim())) continue;
      const ink = luminance(numbers(getComputedStyle(e).color));
      const ratio = (Math.max(ink, ground) + 0.05) / (Math.min(ink, ground) + 0.05);
      worst[getComputedStyle(e).color] = ratio;
    }
    return { ground, worst };
  }

  // where the contents are once the reader has scrolled away
  function contents() {
    const nav = document.querySelector("nav");
    if (!nav) return null;
    window.scrollTo(0, document.documentElement.scrollHeight / 2);
    const { top, bottom, left, right } = nav.getBoundingClientRect();
    const cover = document.querySelector("main").getBoundingClientRect();
    window.scrollTo(0, 0);
    return { top, bottom, beside: right <= cover.left, left };
  }

  function tooWide(width) {
    return unscrolled("body *", width)
      .filter((e) => e.getBoundingClientRect().right > width + 0.5 || e.getBoundingClientRect().left < -0.5)
      .map(name);
  }

  function clipped(width) {
    return unscrolled(TEXT, width)
      .filter((e) => (width > 1000 || !e.matches(".matrix")) && e.scrollWidth > e.clientWidth + 1)
      .map(name);
  }

  function overlapping(width) {
    const blocks = unscrolled(BLOCKS, width);
    const boxes = blocks.map((e) => e.getBoundingClientRect());
    const found = [];
    for (let i = 0; i < blocks.length; i++) {
      for (let j = i + 1; j < blocks.length; j++) {
        const [a, b] = [boxes[i], boxes[j]];
        const across = Math.min(a.right, b.right) - Math.max(a.left, b.left);
        const along = Math.min(a.bottom, b.bottom) - Math.max(a.top, b.top);
        const nested = blocks[i].contains(blocks[j]) || blocks[j].contains(blocks[i]);
        if (across > 1 && along > 1 && !nested) found.push(name(blocks[i]) + " | " + name(blocks[j]));
      }
    }
    return found;
  }

  // dark pixels of a picture drawn small, alone with what all share
  async function ink(picture) {
    const copy = picture.cloneNode(true), shared = document.getElementById("_");
    if (shared) copy.prepend(...shared.cloneNode(true).childNodes);
    const [wide, high] = [170, 116];
    Object.entries({ xmlns: "http://www.w3.org/2000/svg", width: wide, height: high }).forEach(([key, to]) => copy.setAttribute(key, to));
    const image = new Image();
    image.src = `data:image/svg+xml,${encodeURIComponent(new XMLSerializer().serializeToString(copy))}`;
    await image.decode();
    const pen = Object.assign(document.createElement("canvas"), { width: wide, height: high }).getContext("2d");
    pen.fillStyle = "white";
    pen.fillRect(0, 0, wide, high);
    pen.drawImage(image, 0, 0, wide, high);
    const pixels = pen.getImageData(0, 0, wide, high).data;
    let dark = 0;
    for (let i = 0; i < pixels.length; i += 4) if (pixels[i] + pixels[i + 1] + pixels[i + 2] < 600) dark++;
    return dark;
  }

  function pictures() {
    const seen = [...document.querySelectorAll("svg[role=img]")].filter(shown);
    return Promise.all(seen.map(async (picture) => {
      const { width, height } = picture.getBoundingClientRect();
      return { words: picture.getAttribute("aria-label"), ink: await ink(picture), width, ratio: width / height };
    }));
  }

  window.addEventListener("load", async () => {
    const width = document.documentElement.clientWidth;
    const found = {
      width,
      scroll: document.documentElement.scrollWidth,
      wide: tooWide(width),
      clipped: clipped(width),
      over: overlapping(width),
      images: await pictures(),
      contrasts: contrasts(),
      contents: contents(),
      tables: document.querySelectorAll("table").length,
      faults: window.faults,
    };
    window.parent.postMessage(JSON.stringify(found), "*");
  });
})();
