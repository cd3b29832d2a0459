// Cells of the evidence and links to them open the chart of their statistic: #cell=range:incidence opens one at once.
{
  const charts = [...document.querySelectorAll('[data-chart]')], buttons = [...document.querySelectorAll('[data-cell]')];
  const open = name => {
    if (!charts.some(chart => chart.dataset.chart === name)) return;
    for (const chart of charts) chart.hidden = chart.dataset.chart !== name;
    for (const button of buttons) button.setAttribute('aria-pressed', button.dataset.cell === name);
  };
  for (const button of document.querySelectorAll('[data-cell], [data-open]'))
    button.addEventListener('click', () => {
      open(button.dataset.cell ?? button.dataset.open);
      if (button.dataset.open) document.getElementById('evidence').scrollIntoView();
    });
  const first = charts.find(chart => !chart.hidden);
  // Names contain '+', which URLSearchParams would read as a space.
  const asked = decodeURIComponent(location.hash).replace(/^#cell=/, '');
  open(asked || first?.dataset.chart);
}
