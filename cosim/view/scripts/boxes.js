// Boxes as lines: corners from front left counter-clockwise below, then above; the front is crossed.

const EDGES = [[0, 1], [1, 2], [2, 3], [3, 0], [4, 5], [5, 6], [6, 7], [7, 4], [0, 4], [1, 5], [2, 6], [3, 7],
  [0, 7], [3, 4]];
const CORNERS = [[1, 1, -1], [-1, 1, -1], [-1, -1, -1], [1, -1, -1], [1, 1, 1], [-1, 1, 1], [-1, -1, 1], [1, -1, 1]];
const FARTHEST_M = 100;
const BOX_CHOICES = ['labels', 'all objects', 'none'];

function cornersOf({centre, size, yaw}) {
  const cos = Math.cos(yaw), sin = Math.sin(yaw);
  return CORNERS.map(signs => {
    const [x, y, z] = signs.map((sign, axis) => sign * size[axis] / 2);
    return [centre[0] + cos * x - sin * y, centre[1] + sin * x + cos * y, centre[2] + z];
  });
}

// The boxes to show; objects of the twin stand in where nothing is labelled.
function shownBoxes(frame, choice) {
  if (choice === 'none') return [];
  const labels = frame.boxes.filter(box => box.source === 'label');
  if (choice === 'labels' && (labels.length || frame.facts.some(([name]) => name === 'labels'))) return labels;
  return frame.boxes.filter(box => box.source === 'object' && distanceOf(box) < FARTHEST_M)
    .concat(labels);
}

function boxLines(boxes, colourOf) {
  return boxes.flatMap(box => {
    const corners = cornersOf(box), colour = colourOf(box.kind);
    const strength = box.source === 'label' ? 1 : 0.62;
    return EDGES.map(([a, b]) => [corners[a], corners[b], colour.map(value => value * strength)]);
  });
}

const distanceOf = box => Math.hypot(...box.centre);
