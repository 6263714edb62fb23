// Draws a body from any side, without perspective: the player of the report and the live page share it.

const SOFT = 0.42, BRIGHT = 1.14; // of a colour, at the sides of a shape

// the outline that balls of one radius sweep over points: their convex hull, by Andrew's monotone chain
export function hull(points) {
  if (points.length < 3) return points;
  points.sort((a, b) => a[0] - b[0] || a[1] - b[1]);
  const half = (sorted) => {
    const chain = [];
    for (const p of sorted) {
      while (chain.length > 1) {
        const [a, b] = chain.slice(-2);
        if ((b[0] - a[0]) * (p[1] - a[1]) - (b[1] - a[1]) * (p[0] - a[0]) > 0) break;
        chain.pop();
      }
      chain.push(p);
    }
    return chain.slice(0, -1);
  };
  return [...half(points), ...half(points.reverse())];
}

// a vector turned by the quaternion (w, a, b, c), of whatever length
export function turner([w, a, b, c]) {
  const size = w * w + a * a + b * b + c * c || 1, s = 2 / size;
  const rows = [
    [1 - s * (b * b + c * c), s * (a * b - w * c), s * (a * c + w * b)],
    [s * (a * b + w * c), 1 - s * (a * a + c * c), s * (b * c - w * a)],
    [s * (a * c - w * b), s * (b * c + w * a), 1 - s * (a * a + b * b)],
  ];
  return ([p, q, r]) => rows.map(([x, y, z]) => x * p + y * q + z * r);
}

// what an eye sees of the world that looks along +y, turned by ``yaw`` about the vertical and lifted by ``pitch``:
// right, up and depth of a vector
export function eye({ yaw = 0, pitch = 0 } = {}) {
  const [c, s, C, S] = [Math.cos(yaw), Math.sin(yaw), Math.cos(pitch), Math.sin(pitch)];
  return ([x, y, z]) => {
    const deep = c * y - s * x;
    return [c * x + s * y, C * z + S * deep, C * deep - S * z];
  };
}

// the ellipse that is the outline of an ellipsoid, from the projections of its half axes: its matrix is the sum of p pᵀ
export function silhouette(axes) {
  let [a, b, c] = [0, 0, 0];
  for (const [x, y] of axes) (a += x * x), (b += x * y), (c += y * y);
  const middle = (a + c) / 2, apart = Math.hypot((a - c) / 2, b);
  return [Math.sqrt(middle + apart), Math.sqrt(Math.max(middle - apart, 0)), Math.atan2(2 * b, a - c) / 2];
}

const tint = ([r, g, b], share) => `rgb(${[r, g, b].map((value) => Math.round(Math.min(255, value * share))).join(",")})`;

// One figure. ``stand``: the screen's point of the world's origin and its pixels per metre; ``pose`` gives each part's
// place and quaternion; ``mark`` the centre of mass. Returns where shapes were drawn, nearest last, for those who touch.
export function drawFigure(pen, body, { x: left, y: low, scale }, pose, { view, mark, flat = false }) {
  const look = eye(view), drawn = [];
  const parts = Array.from({ length: body.parts }, (_, part) => {
    const { at, turn } = pose(part), turned = turner(turn);
    const seen = (vector, from = at) => look(turned(vector).map((value, k) => value + from[k]));
    return { seen, along: (vector) => look(turned(vector)) };
  });
  const on = ([x, y]) => [left + scale * x, low - scale * y];
  for (const shape of body.shapes) {
    const { seen, along } = parts[shape.part], path = new Path2D();
    let middle, wide, depth, reach = 0;
    if (shape.axes) {
      const centre = seen(shape.centre), [long, short, angle] = silhouette(shape.axes.map(along));
      middle = on(centre);
      depth = centre[2];
      wide = scale * long;
      path.ellipse(...middle, scale * long, scale * short, -angle, 0, 7);
    } else {
      const points = shape.points.map((point) => seen(point));
      depth = points.reduce((sum, point) => sum + point[2], 0) / points.length;
      const line = hull(points.map(on));
      line.forEach(([x, y], k) => path[k ? "lineTo" : "moveTo"](x, y));
      path.closePath();
      reach = scale * shape.radius;
      const xs = line.map(([x]) => x), ys = line.map(([, y]) => y);
      middle = [(Math.min(...xs) + Math.max(...xs)) / 2, (Math.min(...ys) + Math.max(...ys)) / 2];
      wide = Math.min(Math.max(...xs) - Math.min(...xs), 3 * reach || Infinity) / 2 + reach;
    }
    drawn.push({ path, middle, wide, depth, reach, shape });
  }
  if (view) drawn.sort((a, b) => b.depth - a.depth); // else in the order of the page, which is that from the side
  pen.lineJoin = pen.lineCap = "round";
  for (const { path, middle, wide, reach, shape } of drawn) {
    let paint = tint(shape.colour, 1);
    if (!flat && wide > 2) {
      paint = pen.createLinearGradient(middle[0] - wide, 0, middle[0] + wide, 0);
      paint.addColorStop(0, tint(shape.colour, 0.86));
      paint.addColorStop(0.38, tint(shape.colour, BRIGHT));
      paint.addColorStop(1, tint(shape.colour, SOFT + 0.28));
    }
    for (const [colour, more] of [["rgba(0,0,0,.42)", 1.6], [paint, 0]]) {
      pen.strokeStyle = pen.fillStyle = colour;
      pen.lineWidth = Math.max(2 * reach + more, 0.1);
      pen.fill(path);
      pen.stroke(path);
    }
  }
  if (mark) {
    pen.beginPath();
    pen.arc(...on(look(mark)), 4, 0, 7);
    pen.fillStyle = "#f0e442";
    pen.strokeStyle = "#222";
    pen.lineWidth = 1.2;
    pen.fill();
    pen.stroke();
  }
  return drawn;
}

// a canvas of its size on the screen, cleared, in pixels of the page: [pen, width, height]
export function cleared(canvas, wide = 300, high = 260) {
  const ratio = window.devicePixelRatio || 1;
  [wide, high] = [canvas.clientWidth || wide, canvas.clientHeight || high];
  const size = [wide * ratio, high * ratio].map(Math.round);
  if (canvas.width !== size[0] || canvas.height !== size[1]) [canvas.width, canvas.height] = size;
  const pen = canvas.getContext("2d");
  pen.setTransform(ratio, 0, 0, ratio, 0, 0);
  pen.clearRect(0, 0, wide, high);
  return [pen, wide, high];
}
