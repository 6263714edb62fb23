// What linear theory says of the loop, as far as the page draws it: the eigenvalues of φ(Δ), which takes the state from
// one event to the next (paper, eq. pd), and the predicted orbit. Δ_crit, λ and the orbit's state at its event come from
// icmj, which finds them with the care that this takes; here they are only continued in time.

const multiply = (A, B) => A.map((row) => {
  const out = new Array(B[0].length).fill(0);
  row.forEach((value, k) => value && B[k].forEach((other, j) => (out[j] += value * other)));
  return out;
});
const unit = (size) => Array.from({ length: size }, (_, i) => Array.from({ length: size }, (_, j) => +(i === j)));

// e^A by Taylor's series of a small part of A, squared as often as it takes
export function exponential(A) {
  const size = Math.max(...A.map((row) => row.reduce((sum, value) => sum + Math.abs(value), 0)), 1e-300);
  const halves = Math.max(0, Math.ceil(Math.log2(size / 0.25)));
  const small = A.map((row) => row.map((value) => value / 2 ** halves));
  let term = unit(A.length), sum = unit(A.length);
  for (let k = 1; k < 14; k++) {
    term = multiply(term, small).map((row) => row.map((value) => value / k));
    sum = sum.map((row, i) => row.map((value, j) => value + term[i][j]));
  }
  for (let k = 0; k < halves; k++) sum = multiply(sum, sum);
  return sum;
}

// ẇ = F w of the linear plant and the controller, w = (x, a)
export function closed({ plant, controller }, b) {
  const { A, B, C } = plant, { M, N, K } = controller.modes[0], [n, m] = [A.length, M.length];
  const BK = multiply(B, K.map((row) => row.map((value) => -b * value))), NC = multiply(N.map((row) => row.slice(0, C.length)), C);
  return Array.from({ length: n + m }, (_, i) => (i < n ? [...A[i], ...BK[i]] : [...NC[i - n], ...M[i - n]]));
}
const jump = (J, n) => unit(n + J.length).map((row, i) => (i < n ? row : [...row.slice(0, n), ...J[i - n]]));

// φ(Δ) at evenly spaced intervals up to ``last``: [[Δ, eigenvalues], …]
export function locus(model, { b, delay }, resets, last, count = 48) {
  const n = model.plant.A.length, [known] = model.controller.sizes, size = n + known * (delay > 0 ? 2 : 1);
  const F = closed(model, b), flow = (t) => exponential(F.map((row) => row.map((value) => value * t)));
  let w = multiply(jump(resets.J, n), unit(F.length).map((row) => row.slice(0, size)));
  if (delay > 0) w = multiply(jump(resets.G, n), multiply(flow(delay), w));
  const by = (last - delay) / count, each = flow(by), found = [];
  for (let k = 1; k <= count; k++) {
    w = multiply(each, w);
    found.push([delay + k * by, eigenvalues(w.slice(0, size))]);
  }
  return found;
}

// the orbit from its state right after the event: samples (Δ, w) of one interval
export function flown(model, { b, delay }, resets, start, last, count = 96) {
  const n = model.plant.A.length, F = closed(model, b), flow = (t) => exponential(F.map((row) => row.map((value) => value * t)));
  const move = (map, w) => map.map((row) => row.reduce((sum, value, j) => sum + value * w[j], 0));
  let w = move(jump(resets.J, n), start), t = 0;
  const found = [[t, w]];
  for (const [length, parts] of [[delay, Math.round(count / 4)], [last - delay, count]]) {
    const each = length > 0 ? flow(length / parts) : null;
    for (let k = 0; each && k < parts; k++) found.push([(t += length / parts), (w = move(each, w))]);
    if (length === delay && delay > 0) found.push([t, (w = move(jump(resets.G, n), w))]);
  }
  return found;
}

// eigenvalues [re, im] of a real matrix: to Hessenberg form by elimination, then QR steps with Wilkinson's shifts
export function eigenvalues(matrix) {
  const n = matrix.length, H = matrix.map((row) => row.slice());
  for (let k = 1; k < n - 1; k++) {
    let best = k;
    for (let i = k + 1; i < n; i++) if (Math.abs(H[i][k - 1]) > Math.abs(H[best][k - 1])) best = i;
    [H[k], H[best]] = [H[best], H[k]];
    for (const row of H) [row[k], row[best]] = [row[best], row[k]];
    if (!H[k][k - 1]) continue;
    for (let i = k + 1; i < n; i++) {
      const share = H[i][k - 1] / H[k][k - 1];
      if (!share) continue;
      for (let j = 0; j < n; j++) H[i][j] -= share * H[k][j];
      for (const row of H) row[k] += share * row[i];
    }
  }
  const re = H, im = H.map((row) => row.map(() => 0)), found = [];
  const size = (i, j) => Math.hypot(re[i][j], im[i][j]);
  let high = n - 1, trials = 0;
  while (high >= 0) {
    let low = high;
    while (low > 0 && size(low, low - 1) > 2e-16 * (size(low, low) + size(low - 1, low - 1))) low--;
    if (low === high || trials > 500) {
      found.push([re[high][high], im[high][high]]);
      [high, trials] = [high - 1, 0];
      continue;
    }
    // the eigenvalue of the last two rows that is nearer to the last entry; now and then another shift
    const h = high, [a, b, c, d] = [[h - 1, h - 1], [h - 1, h], [h, h - 1], [h, h]].map(([i, j]) => [re[i][j], im[i][j]]);
    const half = [(a[0] - d[0]) / 2, (a[1] - d[1]) / 2];
    const under = [half[0] ** 2 - half[1] ** 2 + b[0] * c[0] - b[1] * c[1], 2 * half[0] * half[1] + b[0] * c[1] + b[1] * c[0]];
    const length = Math.hypot(...under), root = [Math.sqrt((length + under[0]) / 2), Math.sqrt(Math.max(length - under[0], 0) / 2)];
    if (under[1] < 0) root[1] = -root[1];
    const sign = half[0] * root[0] + half[1] * root[1] > 0 ? -1 : 1;
    let shift = [d[0] + half[0] + sign * root[0], d[1] + half[1] + sign * root[1]];
    if (++trials % 11 === 10) shift = [shift[0] + size(h, h - 1), shift[1]];
    for (let i = low; i <= high; i++) (re[i][i] -= shift[0]), (im[i][i] -= shift[1]);
    const turns = [];
    for (let k = low; k < high; k++) {
      const r = Math.hypot(size(k, k), size(k + 1, k)) || 1;
      const [cr, ci, sr, si] = [re[k][k] / r, im[k][k] / r, re[k + 1][k] / r, im[k + 1][k] / r];
      turns.push([cr, ci, sr, si]);
      for (let j = k; j <= high; j++) {
        const [x, y, u, v] = [re[k][j], im[k][j], re[k + 1][j], im[k + 1][j]];
        [re[k][j], im[k][j]] = [cr * x + ci * y + sr * u + si * v, cr * y - ci * x + sr * v - si * u];
        [re[k + 1][j], im[k + 1][j]] = [cr * u - ci * v - sr * x + si * y, cr * v + ci * u - sr * y - si * x];
      }
    }
    turns.forEach(([cr, ci, sr, si], at) => {
      const k = low + at;
      for (let i = low; i <= Math.min(k + 1, high); i++) {
        const [x, y, u, v] = [re[i][k], im[i][k], re[i][k + 1], im[i][k + 1]];
        [re[i][k], im[i][k]] = [x * cr - y * ci + u * sr - v * si, x * ci + y * cr + u * si + v * sr];
        [re[i][k + 1], im[i][k + 1]] = [u * cr + v * ci - x * sr - y * si, v * cr - u * ci - y * sr + x * si];
      }
    });
    for (let i = low; i <= high; i++) (re[i][i] += shift[0]), (im[i][i] += shift[1]);
  }
  return found;
}
