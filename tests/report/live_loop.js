// Runs the page's loop, as it is and with faults planted in it, without the page; says when events came.
const { jobs, theory } = JSON.parse(document.getElementById("jobs").textContent);
const found = jobs.map(({ model, settings, end, fault, pieces }) => {
  const loop = new loops[fault](model, { noise: model.noise.start, ...settings }), begun = performance.now();
  // as frames would look on
  for (let k = 1; k <= pieces; k++) loop.advance((end * k) / pieces);
  const seconds = (performance.now() - begun) / 1000;
  return { events: loop.events.map(({ t }) => t).filter((t) => t <= end), w: Array.from(loop.w), t: loop.t, ended: loop.ended, speed: loop.t / seconds };
});
const seen = {};
seen.eigenvalues = theory.map(({ model, b, delay, delta }) => {
  const resets = model.controller.resets.find((each) => each.delay === delay);
  return locus(model, { b, delay }, resets, delta, 3).at(-1)[1];
});
seen.silhouettes = (JSON.parse(document.getElementById("shapes").textContent)).map(({ axes, view }) => silhouette(axes.map(eye(view))));
const out = document.createElement("pre");
out.id = "found";
out.textContent = JSON.stringify({ runs: found, ...seen });
document.body.append(out);
