// Heights of the ground on a grid, as the scene holds them: 16-bit shares of their range in base64.

function readGround(scene) {
  if (!scene.ground) return null;
  const { columns, rows, low, high } = scene.ground;
  const [[west, east], [south, north]] = scene.bounds;
  const bytes = atob(scene.ground.heights), heights = new Float32Array(columns * rows);
  for (let k = 0; k < heights.length; k++) {
    const share = bytes.charCodeAt(2 * k) + 256 * bytes.charCodeAt(2 * k + 1);
    heights[k] = share === 65535 ? NaN : low + (share / 65534) * (high - low);
  }
  const pitchEast = (east - west) / (columns - 1), pitchNorth = (north - south) / (rows - 1);
  // The height at a crossing; beyond the edge that of the edge, and `low` where it is not known.
  function crossing(column, row) {
    const c = Math.min(Math.max(column, 0), columns - 1), r = Math.min(Math.max(row, 0), rows - 1);
    const height = heights[r * columns + c];
    return Number.isNaN(height) ? low : height;
  }
  function under(e, n) {
    return crossing(Math.round((e - west) / pitchEast), Math.round((n - south) / pitchNorth));
  }
  // The upward normal of the ground at a crossing, not of unit length.
  function normal(column, row) {
    return [
      -(crossing(column + 1, row) - crossing(column - 1, row)) / (2 * pitchEast),
      -(crossing(column, row + 1) - crossing(column, row - 1)) / (2 * pitchNorth),
      1,
    ];
  }
  return { columns, rows, low, high, west, south, pitchEast, pitchNorth, heights, crossing, under, normal };
}

// A picture of the ground, lit from the north-west: an address for an image, its first row the northernmost.
function reliefPicture(ground, theme) {
  const { columns, rows, low, high } = ground, tint = groundTint(theme), span = Math.max(high - low, 1);
  const canvas = document.createElement("canvas");
  canvas.width = columns; canvas.height = rows;
  const ink = canvas.getContext("2d"), picture = ink.createImageData(columns, rows);
  // Gentle country is exaggerated, so that its ridges show.
  const gain = Math.min(Math.max(600 / span, 0.5), 4);
  for (let row = 0; row < rows; row++) for (let column = 0; column < columns; column++) {
    const k = 4 * ((rows - 1 - row) * columns + column);
    const [e, n] = ground.normal(column, row).map((part) => gain * part);
    const lit = (-0.5 * e + 0.5 * n + 0.707) / Math.sqrt(1 + e * e + n * n);
    const bright = Math.min(Math.max(0.96 + 0.42 * (lit - 0.707), 0.55), 1);
    const known = !Number.isNaN(ground.heights[row * columns + column]);
    tint((ground.crossing(column, row) - low) / span).forEach((share, c) => { picture.data[k + c] = 255 * share * bright; });
    picture.data[k + 3] = known ? 255 : 0;
  }
  ink.putImageData(picture, 0, 0);
  return canvas.toDataURL();
}
