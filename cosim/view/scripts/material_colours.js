// Colours of materials: near their nature, far from each other. The first word that a name holds counts.

const MATERIAL_WORDS = [
  ['marking', [250, 236, 110]], ['asphalt patch', [70, 84, 128]], ['asphalt', [104, 122, 166]], ['manhole', [190, 90, 60]],
  ['kerb', [236, 150, 180]], ['paving', [186, 150, 200]], ['cobble', [160, 130, 150]], ['gravel', [178, 164, 140]],
  ['soil', [150, 104, 66]], ['grass', [96, 190, 70]], ['hedge', [30, 150, 92]], ['foliage dark', [36, 176, 110]], ['foliage', [60, 220, 130]],
  ['bark', [196, 128, 74]], ['wood', [214, 160, 96]], ['plaster red', [228, 150, 128]], ['plaster yellow', [240, 206, 120]],
  ['plaster grey', [192, 188, 176]], ['plaster', [240, 226, 196]], ['brick', [214, 92, 66]],
  ['concrete', [170, 178, 186]], ['stone', [140, 160, 160]], ['roof', [168, 62, 62]], ['tile', [200, 84, 60]],
  ['metal', [150, 200, 214]], ['steel', [150, 200, 214]], ['window', [90, 220, 250]], ['glass', [90, 220, 250]], ['paint', [70, 160, 255]], ['tyre', [120, 90, 150]],
  ['rubber', [120, 90, 150]], ['rim', [210, 214, 240]], ['plate', [255, 255, 255]], ['retro', [255, 255, 255]],
  ['sign', [255, 90, 40]], ['skin', [255, 190, 160]],
  ['fabric', [255, 110, 199]], ['cloth', [255, 110, 199]], ['jeans', [110, 110, 230]], ['plastic', [230, 190, 60]],
];

function materialColour(frame, row) {
  const name = frame.materials[row] ?? '', word = MATERIAL_WORDS.find(([part]) => name.includes(part));
  return word ? word[1] : numberColour(row);
}
