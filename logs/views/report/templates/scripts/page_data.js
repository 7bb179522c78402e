// What the page carries as data: JSON in script elements, apart from all code.

function pageData(id) {
  const holder = document.getElementById(id);
  return holder ? JSON.parse(holder.textContent) : null;
}

// A name as a chart shows it: plotly.js reads tags in words, and a name may hold some.
function plainName(name) {
  return name.replace(/&/g, "&amp;").replace(/</g, "&lt;").replace(/>/g, "&gt;");
}

// A number with a true minus sign and so many decimals; an en dash for none.
function numberText(value, digits) {
  if (value === null || !Number.isFinite(value)) return "–";
  const text = value.toFixed(digits);
  return (Number(text) === 0 ? text.replace("-", "") : text).replace("-", "−");
}
