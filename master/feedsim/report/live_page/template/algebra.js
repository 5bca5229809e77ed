// Linear algebra of a few columns, and statistics: what numpy gives feedsim.analysis.circle.

const absolute_median = values => median(values.map(Math.abs));
const range_of = values => largest(values) - least(values);

// The symmetric matrix of the columns' products, each sample weighted.
function normal_matrix(columns, weights) {
  const K = columns.length, result = Array.from({ length: K }, () => new Float64Array(K));
  for (let i = 0; i < K; i++) {
    const weighted = weights ? columns[i].map((entry, k) => entry * weights[k]) : columns[i];
    for (let j = i; j < K; j++) result[i][j] = result[j][i] = dot(weighted, columns[j]);
  }
  return result;
}

function dot(a, b) {
  let sum = 0;
  for (let k = 0; k < a.length; k++) sum += a[k] * b[k];
  return sum;
}

const times = (matrix, vector) => matrix.map(row => dot(row, vector));
const product = (A, B) => A.map(row => Float64Array.from(B[0], (_, j) => row.reduce((sum, entry, k) => sum + entry * B[k][j], 0)));
const transposed = A => Array.from(A[0], (_, j) => Float64Array.from(A, row => row[j]));

// Sum of columns, each times its value.
function combined(columns, values, count) {
  const result = new Float64Array(count);
  columns.forEach((column, i) => { for (let k = 0; k < count; k++) result[k] += values[i] * column[k]; });
  return result;
}

// Eigenvalues and, as columns, eigenvectors of a symmetric matrix: cyclic Jacobi rotations.
function eigen(matrix) {
  const n = matrix.length, A = matrix.map(row => Float64Array.from(row)), V = A.map((_, i) => Float64Array.from({ length: n }, (_, j) => i === j ? 1 : 0));
  for (let sweep = 0; sweep < 60; sweep++) {
    let off = 0, size = 0;
    for (let i = 0; i < n; i++) for (let j = 0; j < n; j++) { size += A[i][j] ** 2; if (i !== j) off += A[i][j] ** 2; }
    if (off <= 1e-40 * size) break;
    for (let p = 0; p < n; p++) for (let q = p + 1; q < n; q++) {
      if (A[p][q] === 0) continue;
      const theta = (A[q][q] - A[p][p]) / (2 * A[p][q]), t = (theta < 0 ? -1 : 1) / (Math.abs(theta) + Math.hypot(theta, 1)), c = 1 / Math.hypot(t, 1), s = t * c;
      for (let k = 0; k < n; k++) { const a = A[k][p], b = A[k][q]; A[k][p] = c * a - s * b; A[k][q] = s * a + c * b; }
      for (let k = 0; k < n; k++) { const a = A[p][k], b = A[q][k]; A[p][k] = c * a - s * b; A[q][k] = s * a + c * b; }
      for (let k = 0; k < n; k++) { const a = V[k][p], b = V[k][q]; V[k][p] = c * a - s * b; V[k][q] = s * a + c * b; }
    }
  }
  return { values: A.map((row, i) => row[i]), vectors: V };
}

// Inverse of a symmetric matrix on what of it is larger than rounding: `share` of its largest eigenvalue.
function pseudo_inverse(matrix, share = matrix.length * Number.EPSILON) {
  const { values, vectors } = eigen(matrix), least_size = share * largest(values.map(Math.abs));
  return vectors.map(row => Float64Array.from(vectors, other => values.reduce((sum, value, k) => sum + (Math.abs(value) > least_size ? row[k] * other[k] / value : 0), 0)));
}

const least_squares = (columns, target) => times(pseudo_inverse(normal_matrix(columns)), columns.map(column => dot(column, target)));

// Sums and counts of values by the number of their block: numpy.bincount.
function by_block(blocks, values, count = 0) {
  const length = blocks.length ? Math.max(count, largest(blocks) + 1) : count, sums = new Float64Array(length), counts = new Float64Array(length);
  blocks.forEach((block, k) => { sums[block] += values[k]; counts[block]++; });
  return { sums, counts };
}

// Blocks numbered from 0 on, without gaps.
function numbered(blocks) {
  const numbers = new Map();
  return Int32Array.from(blocks, entry => { if (!numbers.has(entry)) numbers.set(entry, numbers.size); return numbers.get(entry); });
}

// Mean over `count` neighbours; fewer at the ends.
function averaged(values, count) {
  const n = values.length, width = Math.min(count, n), before = Math.floor(width / 2);
  return Float64Array.from(values, (_, i) => {
    const from = Math.max(i - before, 0), to = Math.min(i - before + width, n);
    let sum = 0;
    for (let k = from; k < to; k++) sum += values[k];
    return sum / (to - from);
  });
}

function quantile(values, share) {
  const sorted = Float64Array.from(values).sort(), at = share * (sorted.length - 1), k = Math.min(Math.floor(at), sorted.length - 2);
  return sorted.length < 2 ? sorted[0] : sorted[k] + (at - k) * (sorted[k + 1] - sorted[k]);
}

// Linear between points with ascending x; level beyond their ends, or repeated with a period.
function interpolated(wanted, x, y, period = 0) {
  const n = x.length, X = period ? [x[n - 1] - period, ...x, x[0] + period] : x, Y = period ? [y[n - 1], ...y, y[0]] : y;
  let k = 0;
  return Float64Array.from(wanted, at => {
    if (k && at < X[k]) k = 0;
    while (k + 2 < X.length && at >= X[k + 1]) k++;
    if (at <= X[0]) return Y[0];
    if (at >= X[X.length - 1]) return Y[Y.length - 1];
    return Y[k] + (Y[k + 1] - Y[k]) / (X[k + 1] - X[k]) * (at - X[k]);
  });
}

// Squares of the absolute values of the discrete Fourier transform, of orders 0 to n/2 (Bluestein, L. I., IEEE Trans. AU-18 (1970): any n).
function power_spectrum(values) {
  const n = values.length, size = 2 ** Math.ceil(Math.log2(2 * n)), re = new Float64Array(size), im = new Float64Array(size), w_re = new Float64Array(size), w_im = new Float64Array(size);
  for (let k = 0; k < n; k++) {
    const angle = Math.PI * ((k * k) % (2 * n)) / n, c = Math.cos(angle), s = Math.sin(angle);
    re[k] = values[k] * c;
    im[k] = -values[k] * s;
    w_re[k] = c;
    w_im[k] = s;
    if (k) { w_re[size - k] = c; w_im[size - k] = s; }
  }
  transform(re, im, 1);
  transform(w_re, w_im, 1);
  for (let k = 0; k < size; k++) { const a = re[k], b = im[k]; re[k] = a * w_re[k] - b * w_im[k]; im[k] = a * w_im[k] + b * w_re[k]; }
  transform(re, im, -1);
  return Float64Array.from({ length: Math.floor(n / 2) + 1 }, (_, k) => (re[k] ** 2 + im[k] ** 2) / size ** 2);
}

// In place, a power of two; sense -1: the inverse, times its length.
function transform(re, im, sense) {
  const n = re.length;
  for (let i = 1, j = 0; i < n; i++) {
    let bit = n >> 1;
    for (; j & bit; bit >>= 1) j ^= bit;
    j ^= bit;
    if (i < j) { [re[i], re[j]] = [re[j], re[i]]; [im[i], im[j]] = [im[j], im[i]]; }
  }
  const c = Float64Array.from({ length: n / 2 }, (_, k) => Math.cos(2 * Math.PI * k / n)), s = Float64Array.from({ length: n / 2 }, (_, k) => -sense * Math.sin(2 * Math.PI * k / n));
  for (let size = 2; size <= n; size *= 2) {
    const half = size / 2, stride = n / size;
    for (let i = 0; i < n; i += size) for (let k = 0; k < half; k++) {
      const a = i + k, b = a + half, u = re[b] * c[k * stride] - im[b] * s[k * stride], v = re[b] * s[k * stride] + im[b] * c[k * stride];
      re[b] = re[a] - u;
      im[b] = im[a] - v;
      re[a] += u;
      im[a] += v;
    }
  }
}
