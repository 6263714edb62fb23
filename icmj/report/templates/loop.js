// The closed loop of a body and a controller, from instant to instant. It knows no page: `icmj live` gives it a
// description (icmj/report/live.py), which is the controller's Realisation as both simulators of icmj read it.
//
// Between instants the state w = (x, a) moves as
//     ẋ = f(x, b (u + d)),   ȧ = M a + N v,   u = −K a − S v,   v = y + n, or the same of a delay ago,   y = C x,
// by the Runge–Kutta rule of fourth order on a grid of steps that begins anew at every instant at which something happens.
// What is due at an instant t happens in this order, each judged on what the one before left:
//
//   1. what acts on the plant changes: impulses move x, windows of disturbances open and close; from t on the value
//      from the right holds;
//   2. actions that are due, oldest first: a := G a;
//   3. guards: an event rule is watched from its least time on, and is judged on the state after 1 and 2. One that has
//      crossed its level |R a| = 1 fires; one that is beyond it when its least time ends fires at that instant, after
//      the action that may fall on it; a switch of mode follows the signs of its guards;
//   4. the event: a := J a; its action joins the queue, for t + delay; the rule waits for its least time;
//   5. the ends: fallen, or no longer finite.
//
// Instants are compared as instants, never as parts of a step: a step that lands on one gets its very time. The start is
// an event at t = 0. Steps are as long as the grid says, whoever looks on: a frame of a page shows the step it finds.

const CLOSE = 1e-13; // s, of the instant of an event
const LONGEST = 2; // s, of a delay
const SAME = 1e-9; // of a step: a target this much further than a step is reached by it

const product = (rows, values, out, from = 0, first = 0) => { // out = rows · values, from places on
  for (let i = 0; i < rows.length; i++) {
    let sum = 0;
    for (let j = 0; j < rows[i].length; j++) sum += rows[i][j] * values[from + j];
    out[first + i] = sum;
  }
};

// Links in a vertical plane, each a hinge or a slide (icmj/engine/planar_chain.py): where they are, and how they accelerate.
export class Chain {
  constructor(links) {
    Object.assign(this, links);
    const n = (this.n = links.parent.length), room = (size) => new Float64Array(size);
    for (const name of ["angle", "spin", "px", "pz", "bx", "bz", "cx", "cz", "qx", "qz", "force"]) this[name] = room(n);
    for (const name of ["jx", "jz", "jr", "mass_"]) this[name] = room(n * n);
    this.place(room(n));
    this.weigh();
    this.held = Float64Array.from(this.force); // what holds it at its operating point
  }
  // angles, joints (p) and centres of mass (c) at the positions x; and of each centre what a unit of each position moves
  place(x, speed) {
    const { n, parent, turn, axis, joint, centre } = this;
    for (let i = 0; i < n; i++) {
      const p = parent[i], before = p < 0 ? 0 : this.angle[p], spun = p < 0 || !speed ? 0 : this.spin[p];
      const c = Math.cos(before), s = Math.sin(before), v = speed ? speed[n + i] : 0;
      const ax = joint[i][0] + axis[i][0] * x[i], az = joint[i][1] + axis[i][1] * x[i];
      const rx = c * ax + s * az, rz = c * az - s * ax;
      const sx = c * axis[i][0] + s * axis[i][1], sz = c * axis[i][1] - s * axis[i][0];
      this.px[i] = (p < 0 ? 0 : this.px[p]) + rx;
      this.pz[i] = (p < 0 ? 0 : this.pz[p]) + rz;
      // accelerations without those of the positions: towards the joint before, and sideways on a turning rail
      this.bx[i] = (p < 0 ? 0 : this.bx[p]) - spun * spun * rx + 2 * spun * v * sz;
      this.bz[i] = (p < 0 ? 0 : this.bz[p]) - spun * spun * rz - 2 * spun * v * sx;
      const angle = (this.angle[i] = before + turn[i] * x[i]), spin = (this.spin[i] = spun + turn[i] * v);
      const C = Math.cos(angle), S = Math.sin(angle);
      const gx = C * centre[i][0] + S * centre[i][1], gz = C * centre[i][1] - S * centre[i][0];
      this.cx[i] = this.px[i] + gx;
      this.cz[i] = this.pz[i] + gz;
      this.qx[i] = this.bx[i] - spin * spin * gx;
      this.qz[i] = this.bz[i] - spin * spin * gz;
      for (let j = 0; j < n; j++) this.jx[j * n + i] = this.jz[j * n + i] = this.jr[j * n + i] = 0;
      for (let j = i; j >= 0; j = parent[j]) {
        const at = j * n + i;
        if (turn[j]) {
          this.jx[at] = turn[j] * (this.cz[i] - this.pz[j]);
          this.jz[at] = -turn[j] * (this.cx[i] - this.px[j]);
          this.jr[at] = turn[j];
        } else {
          const q = parent[j], a = q < 0 ? 0 : this.angle[q];
          this.jx[at] = Math.cos(a) * axis[j][0] + Math.sin(a) * axis[j][1];
          this.jz[at] = Math.cos(a) * axis[j][1] - Math.sin(a) * axis[j][0];
        }
      }
    }
  }
  // forces of weight and of turning on the positions, and the matrix of masses, where the links are
  weigh() {
    const { n, mass, inertia, armature, gravity, jx, jz, jr } = this;
    for (let j = 0; j < n; j++) {
      let force = 0;
      for (let k = 0; k < n; k++)
        force += mass[k] * (jx[j * n + k] * (this.qx[k] - gravity[0]) + jz[j * n + k] * (this.qz[k] - gravity[1]));
      this.force[j] = force;
      for (let l = 0; l <= j; l++) {
        let sum = j === l ? armature[j] : 0;
        for (let k = j; k < n; k++)
          sum += mass[k] * (jx[j * n + k] * jx[l * n + k] + jz[j * n + k] * jz[l * n + k]) +
            inertia[k] * jr[j * n + k] * jr[l * n + k];
        this.mass_[j * n + l] = sum;
      }
    }
  }
  // solve (matrix of masses) out = force, by its factor L Lᵀ, in place
  solve(force, out, at = 0) {
    const { n, mass_: L } = this;
    for (let j = 0; j < n; j++)
      for (let i = j; i < n; i++) {
        let sum = L[i * n + j];
        for (let k = 0; k < j; k++) sum -= L[i * n + k] * L[j * n + k];
        L[i * n + j] = i === j ? Math.sqrt(sum) : sum / L[j * n + j];
      }
    for (let i = 0; i < n; i++) {
      let sum = force[i];
      for (let k = 0; k < i; k++) sum -= L[i * n + k] * out[at + k];
      out[at + i] = sum / L[i * n + i];
    }
    for (let i = n - 1; i >= 0; i--) {
      let sum = out[at + i];
      for (let k = i + 1; k < n; k++) sum -= L[k * n + i] * out[at + k];
      out[at + i] = sum / L[i * n + i];
    }
  }
  rates(w, u, out) {
    const { n, T_a, T_u, stiffness, damping, force, held } = this;
    this.place(w, w);
    this.weigh();
    for (let i = 0; i < n; i++) {
      let sum = held[i] - force[i] - stiffness[i] * w[i] - damping[i] * w[n + i];
      for (let j = 0; j < T_a[i].length; j++) sum += T_a[i][j] * w[2 * n + j];
      for (let j = 0; j < u.length; j++) sum += T_u[i][j] * u[j];
      force[i] = sum;
      out[i] = w[n + i];
    }
    this.solve(force, out, n);
    for (let i = 0; i < this.lags.length; i++) {
      const row = this.lags[i], size = row.length - u.length;
      let sum = 0;
      for (let j = 0; j < size; j++) sum += row[j] * w[j];
      for (let j = 0; j < u.length; j++) sum += row[size + j] * u[j];
      out[2 * n + i] = sum;
    }
  }
  // what an impulse [N s] along x at a point of a link's line through its joint changes of the speeds, for the posture x
  struck(x, link, height, impulse) {
    this.place(x);
    const { n } = this, out = new Float64Array(n), force = new Float64Array(n);
    for (let j = link; j >= 0; j = this.parent[j])
      force[j] = impulse * (this.turn[j] ? this.turn[j] * (height - this.pz[j]) : this.jx[j * n + link]);
    this.weigh();
    this.solve(force, out);
    return out;
  }
}

// A plant given by matrices: ẋ = A x + B u.
export class Linear {
  constructor({ A, B }) {
    Object.assign(this, { A, B });
  }
  rates(w, u, out) {
    const { A, B } = this, n = A.length;
    for (let i = 0; i < n; i++) {
      let sum = 0;
      for (let j = 0; j < n; j++) sum += A[i][j] * w[j];
      for (let j = 0; j < u.length; j++) sum += B[i][j] * u[j];
      out[i] = sum;
    }
  }
}

// Outputs and their rates at the ends of the steps so far, for a controller that reads those of a while ago.
class History {
  constructor(y) {
    this.first = Float64Array.from(y);
    this.pieces = [];
    this.at = 0;
  }
  add(piece) {
    this.pieces.push(piece);
    if (this.pieces.length > 8000 && this.pieces[4000].end < piece.end - LONGEST) this.pieces.splice(0, 4000), (this.at = 0);
  }
  // before t = 0 the outputs of the start, held; after it the cubic through values and rates at both ends of a step
  read(t, out, first) {
    const { pieces } = this, count = this.first.length;
    if (t <= 0 || !pieces.length) {
      for (let i = 0; i < count; i++) out[first + i] = this.first[i];
      return;
    }
    let at = Math.min(this.at, pieces.length - 1);
    while (at > 0 && pieces[at].begin > t) at--;
    while (at < pieces.length - 1 && pieces[at].end < t) at++;
    this.at = at;
    const { begin, end, y, dy, z, dz } = pieces[at], h = end - begin, s = (t - begin) / h, r = 1 - s;
    for (let i = 0; i < count; i++)
      out[first + i] = r * r * ((1 + 2 * s) * y[i] + h * s * dy[i]) + s * s * ((1 + 2 * r) * z[i] - h * r * dz[i]);
  }
}

export class Loop {
  // settings: b, q (threshold), delay [s], least (shortest interval between events) [s], noise (factor), linear (plant)
  constructor(model, settings = {}) {
    const { plant, controller } = model;
    this.model = model;
    this.settings = { b: model.b, q: model.q, delay: model.delay, least: model.least, noise: 1, linear: false, ...settings };
    [this.n, this.m] = [plant.A.length, controller.modes[0].M.length];
    this.nu = plant.B[0].length;
    this.ny = plant.C.length;
    this.tapped = controller.tapped;
    this.size = this.n + this.m;
    const room = (size = this.size) => new Float64Array(size);
    [this.w, this.from, this.trial] = [room(), room(), room()];
    this.k = [room(), room(), room(), room(), room()];
    [this.u, this.d, this.y, this.v] = [room(this.nu), room(this.nu), room(this.ny), room(controller.readings)];
    this.scratch = room();
    this.beside = { values: room(this.nu + this.ny) };
    this.noisy = model.acting.some(([on]) => on); // readings
    this.faces = controller.cuts.length - 1;
    this.levels = [0, 1].map(() => room(2 * Math.max(this.faces, 1)));
    this.bodies = { true: new Linear(plant), false: plant.chain ? new Chain(plant.chain) : new Linear(plant) };
    this.edges = [...new Set(model.acting.flatMap(([, , , , , start, end]) => [start, end]))]
      .filter((t) => t !== null && t > 0).sort((a, b) => a - b);
    this.reset();
  }

  // to t = 0, at the state given or that of the run file; an event
  reset({ x = this.model.start.x, a = this.model.start.a } = {}) {
    this.w.set(x);
    this.w.set(a, this.n);
    Object.assign(this, { t: 0, grid: 0, count: 0, last: 0, mode: 0, ended: "", edge: 0, steps: 0, fired: 0 });
    [this.queue, this.marks, this.events] = [[], [], []];
    this.adapt();
    this.outputs(this.w);
    this.history = new History(this.y);
    this.signs = this.model.controller.guards.map(() => 0);
    if (this.tapped) {
      this.mark(0);
      this.readings(0, this.w);
      this.signs = this.model.controller.guards.map((guard) => (this.guard(guard) > 0 ? 1 : 0));
      this.choose();
    }
    if (this.faces) this.begin();
    this.refresh();
  }

  // change a setting where the motion is: no event, no new grid
  set(name, value) {
    this.settings[name] = value;
    this.adapt();
    this.refresh();
    // beyond a threshold that has become lower: an event is due
    if (this.armed && this.levels[0][2 * this.face(this.levels[0])] >= 0) [this.armed, this.watch] = [false, this.t];
  }

  adapt() {
    const { settings, model } = this, { controller } = model;
    this.plant = this.bodies[settings.linear];
    this.h = settings.linear ? model.step.linear : model.step.body;
    const size = model.q / settings.q;
    this.R = controller.R.map((row) => row.map((value) => value * size));
    const resets = controller.resets;
    this.resets = resets.reduce((best, each) => (
      Math.abs(each.delay - settings.delay) < Math.abs(best.delay - settings.delay) ? each : best), resets[0]);
    this.wait = Math.max(settings.least, this.faces ? settings.delay : 0);
    // a rule that waits goes on waiting: for its least time since the last event, and for an action under way
    if (this.faces) this.watch = Math.max(this.last + this.wait, ...this.queue.map(({ t }) => t));
    this.armed = this.faces > 0 && this.t > this.watch;
  }

  // an impulse: what it changes of the plant's state, at the present instant
  push(change) {
    for (let i = 0; i < this.n; i++) this.w[i] += change[i];
    if (this.tapped) this.mark(this.t);
    [this.grid, this.count] = [this.t, 0];
    this.refresh();
  }

  // what acts at t of the disturbances that act from ``since`` on: beside the commands, then on the readings; shape (nu + ny)
  disturb(t, since) {
    const { beside, model: { acting }, settings: { noise } } = this;
    if (t === beside.t && since === beside.since && noise === beside.noise) return beside.values;
    Object.assign(beside, { t, since, noise }).values.fill(0);
    for (let k = 0; noise && k < acting.length; k++) {
      const term = acting[k];
      if (term[5] <= since && (term[6] === null || since < term[6]))
        beside.values[term[0] * this.nu + term[1]] += noise * term[2] * Math.cos(term[3] * t + term[4]);
    }
    return beside.values;
  }

  outputs(w) {
    product(this.model.plant.C, w, this.y);
  }

  readings(t, w) {
    const { controller, plant } = this.model;
    if (!this.tapped) {
      product(plant.C, w, this.v);
      const errors = this.disturb(t, this.since);
      for (let i = 0; i < this.ny; i++) this.v[i] += errors[this.nu + i];
      return;
    }
    controller.taps.forEach((share, k) => {
      const ago = t - share * this.settings.delay, errors = this.noisy ? this.disturb(Math.max(ago, 0), Math.max(ago, 0)) : null;
      this.history.read(ago, this.v, k * this.ny);
      for (let i = 0; errors && i < this.ny; i++) this.v[k * this.ny + i] += errors[this.nu + i];
    });
  }

  rates(t, w, out) {
    const { K, S, M, N } = this.model.controller.modes[this.mode], { n, m, u, d, v } = this;
    this.readings(t, w);
    const beside = this.disturb(t, this.since);
    for (let i = 0; i < u.length; i++) {
      let sum = 0;
      for (let j = 0; j < m; j++) sum -= K[i][j] * w[n + j];
      for (let j = 0; j < v.length; j++) sum -= S[i][j] * v[j];
      u[i] = sum;
      d[i] = this.settings.b * (sum + beside[i]);
    }
    this.plant.rates(w, d, out);
    for (let i = 0; i < m; i++) {
      let sum = 0;
      for (let j = 0; j < m; j++) sum += M[i][j] * w[n + j];
      for (let j = 0; j < v.length; j++) sum += N[i][j] * v[j];
      out[n + i] = sum;
    }
  }

  // rates and levels of the rule at the present state; from here on they are those of the step's begin
  refresh() {
    this.since = this.t;
    this.rates(this.t, this.w, this.k[0]);
    this.level(this.w, this.k[0], this.levels[0]);
  }

  // E_j = |R_j a|² − 1 of each face, and its rate
  level(w, rate, out) {
    const { cuts } = this.model.controller;
    for (let face = 0; face < this.faces; face++) {
      let value = -1, slope = 0;
      for (let row = cuts[face]; row < cuts[face + 1]; row++) {
        let part = 0, moves = 0;
        for (let j = 0; j < this.m; j++) {
          part += this.R[row][j] * w[this.n + j];
          moves += this.R[row][j] * rate[this.n + j];
        }
        value += part * part;
        slope += 2 * part * moves;
      }
      [out[2 * face], out[2 * face + 1]] = [value, slope];
    }
  }
  // the face that is furthest out
  face(levels) {
    let best = 0;
    for (let face = 1; face < this.faces; face++) if (levels[2 * face] > levels[2 * best]) best = face;
    return best;
  }
  // how near the rule is to an event: 0 at a reset, 1 at its threshold
  get share() {
    return this.faces ? Math.sqrt(Math.max(this.levels[0][2 * this.face(this.levels[0])] + 1, 0)) : NaN;
  }

  // from the begin of a step by ``length``, to w and k[4]: classical Runge–Kutta
  runge(begin, length, end) {
    const { from, trial, k, w, size } = this;
    for (let stage = 1; stage < 4; stage++) {
      const by = stage < 3 ? length / 2 : length;
      for (let i = 0; i < size; i++) trial[i] = from[i] + by * k[stage - 1][i];
      this.rates(begin + by, trial, k[stage]);
    }
    for (let i = 0; i < size; i++) w[i] = from[i] + length * (k[0][i] / 6 + k[1][i] / 3 + k[2][i] / 3 + k[3][i] / 6);
    this.t = end;
    this.rates(end, w, k[4]);
    this.level(w, k[4], this.levels[1]);
  }

  // whether the cubic through E and its rates at both ends may rise to zero between them, with a margin for its error
  touches([E, dE], [F, dF], length, margin) {
    const slope = (F - E) / length, c = (3 * slope - 2 * dE - dF) / length, d = (dE + dF - 2 * slope) / length ** 2;
    const inside = c * c - 3 * d * dE;
    if (inside <= 0) return false;
    const s = c < 0 ? dE / (Math.sqrt(inside) - c) : (-c - Math.sqrt(inside)) / (3 * d);
    return s > 0 && s < length && E + s * (dE + s * (c + s * d)) + margin * (Math.max(E, F) + 1) >= 0;
  }
  crosses(begin, length) { // looks at halves of the step, and of those at halves, until none may touch
    const { from, levels, faces } = this, start = levels[0].slice();
    const margin = (part) => (10 * (2 * this.model.rate * part) ** 4) / 384;
    const among = (left, right, part) => {
      for (let face = 0; face < faces; face++) {
        const at = [2 * face, 2 * face + 2];
        if (this.touches(left.slice(...at), right.slice(...at), part, margin(part))) return true;
      }
      return false;
    };
    const end = levels[1].slice();
    if (end[2 * this.face(end)] < 0 && !among(start, end, length)) return false;
    if (end[2 * this.face(end)] >= 0 && !among(start, end, length)) return this.locate(begin, 0, length);
    for (let pieces = 2; pieces <= 64; pieces *= 2) {
      let left = start, open = false;
      for (let j = 1; j <= pieces; j++) {
        const s = (length * j) / pieces;
        this.runge(begin, s, begin + s);
        if (levels[1][2 * this.face(levels[1])] >= 0) return this.locate(begin, (length * (j - 1)) / pieces, s);
        const right = levels[1].slice();
        open ||= among(left, right, length / pieces);
        left = right;
      }
      if (!open) break;
    }
    this.runge(begin, length, this.end);
    return false;
  }
  // the instant between two parts of a step at which E reaches zero: Newton's rule, kept between them
  locate(begin, low, high) {
    const { levels } = this;
    let s = high;
    for (let trial = 0; trial < 60; trial++) {
      const face = this.face(levels[1]), E = levels[1][2 * face], dE = levels[1][2 * face + 1];
      if (E >= 0) high = s;
      else low = s;
      const newton = dE > 0 ? s - E / dE : Infinity;
      if (Math.abs(newton - s) <= CLOSE || high - low <= CLOSE) break;
      s = newton > low && newton < high && trial % 8 !== 7 ? newton : (low + high) / 2;
      this.runge(begin, s, begin + s);
    }
    return true;
  }

  guard({ Q, c }) {
    let sum = c;
    for (let i = 0; i < Q.length; i++) for (let j = 0; j < Q.length; j++) sum += this.v[i] * Q[i][j] * this.v[j];
    return sum;
  }
  choose() {
    const { table } = this.model.controller, before = this.mode;
    if (table) this.mode = table[this.mode][this.signs.reduce((sum, sign, k) => sum + (sign << k), 0)];
    return this.mode !== before;
  }
  // the first instant after t, up to ``end``, at which a guard has changed its sign: its readings are known ahead
  turns(t, end) {
    const { guards } = this.model.controller;
    const differs = (guard, at) => (this.readings(at, this.w), (this.guard(guards[guard]) > 0 ? 1 : 0) !== this.signs[guard]);
    let first = Infinity, which = -1;
    for (let guard = 0; guard < guards.length; guard++) {
      let low = t, high = [(t + end) / 2, end].find((at) => differs(guard, at));
      if (high === undefined) continue;
      while (high - low > CLOSE / 4 && (low + high) / 2 > low && (low + high) / 2 < high)
        if (differs(guard, (low + high) / 2)) high = (low + high) / 2;
        else low = (low + high) / 2;
      if (high < first) [first, which] = [high, guard];
    }
    return [first, which];
  }
  // what jumps at t bends what is read a delay later, and what that moves, a delay after it
  mark(t) {
    for (const share of this.model.controller.taps)
      for (let times = 1; times < 4; times++) this.marks.push(t + times * share * this.settings.delay);
    this.marks.sort((a, b) => a - b);
  }

  // one step of the grid, or what is left of it to the next instant; whether there was an event
  step() {
    const { w, from, k, queue } = this, due = queue.length ? queue[0].t : Infinity;
    const edge = this.edge < this.edges.length ? this.edges[this.edge] : Infinity;
    const arm = this.armed || !this.faces ? Infinity : this.watch;
    const target = Math.min(arm, due, edge, this.marks.length ? this.marks[0] : Infinity);
    const begin = this.t, lands = target - begin <= this.h * (1 + SAME);
    let length = lands ? Math.max(target - begin, 0) : this.h, fired = false, turned = -1;
    this.end = lands ? Math.max(target, begin) : this.grid + (this.count + 1) * this.h;
    if (length > 0) {
      from.set(w);
      this.since = begin;
      if (this.signs.length) {
        const [at, which] = this.turns(begin, this.end);
        if (which >= 0) [this.end, length, turned] = [at, at - begin, which];
      }
      this.runge(begin, length, this.end);
      if (this.armed) fired = this.crosses(begin, length);
      if (this.tapped) this.remember(begin);
      k[0].set(k[4]);
      this.levels[0].set(this.levels[1]);
    }
    const t = this.t, landed = lands && t >= target;
    this.steps++;
    // 1. what acts on the plant changes
    const passed = landed && t >= edge;
    if (passed) {
      this.edge++;
      if (this.tapped) this.mark(t);
    }
    while (this.marks.length && this.marks[0] <= t) this.marks.shift();
    // 2. actions
    const acts = landed && t >= due;
    if (acts) this.apply(queue.shift().G);
    if (passed || acts) this.refresh();
    // 3. guards, on the state after these
    if (landed && t >= arm) {
      this.armed = true;
      fired = this.levels[0][2 * this.face(this.levels[0])] >= 0;
    }
    if (turned >= 0) {
      this.signs[turned] = 1 - this.signs[turned];
      fired = this.choose();
      if (fired) this.mark(t);
    }
    // 4. the event
    if (fired) {
      this.events.push({ t, interval: t - this.last, w: Array.from(w) });
      this.last = t;
      this.fired++;
      if (this.faces) this.begin();
      this.refresh();
    }
    [this.grid, this.count] = fired || landed || turned >= 0 ? [t, 0] : [this.grid, this.count + 1];
    // 5. the ends
    const { limit } = this.model;
    for (const [i, most] of limit) if (Math.abs(w[i]) > most) this.ended = "fell";
    for (let i = 0; i < this.size; i++) if (!(Math.abs(w[i]) < 1e10)) this.ended = "diverged";
    return fired;
  }
  // a := J a now, its action later, and the rule waits
  begin() {
    const { J, G, delay } = this.resets;
    this.apply(J);
    if (delay > 0) this.queue.push({ t: this.t + delay, G });
    this.watch = Math.max(this.t + this.wait, ...this.queue.map(({ t }) => t));
    this.armed = this.watch <= this.t;
  }
  apply(map) {
    product(map, this.w, this.scratch, this.n);
    for (let i = 0; i < this.m; i++) this.w[this.n + i] = this.scratch[i];
  }
  remember(begin) {
    const { C } = this.model.plant, at = (vector) => {
      const out = new Float64Array(this.ny);
      product(C, vector, out);
      return out;
    };
    const [y, dy, z, dz] = [at(this.from), at(this.k[0]), at(this.w), at(this.k[4])];
    this.history.add({ begin, end: this.t, y, dy, z, dz });
  }

  // whole steps until ``t`` is reached; what a page shows of them is its own affair
  advance(t, seen = () => {}) {
    while (this.t < t && !this.ended) seen(this.step());
  }
}
