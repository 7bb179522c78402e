// Opens the section that a link or the address names, and all sections while the page is printed.

function startFolds() {
  function openNamed(hash) {
    const named = hash.length > 1 ? document.getElementById(decodeURIComponent(hash.slice(1))) : null;
    if (!named) return;
    for (const fold of named.querySelectorAll(":scope > details.fold")) fold.open = true;
    named.scrollIntoView();
  }
  let opened = [];
  window.addEventListener("beforeprint", () => {
    opened = [...document.querySelectorAll("details:not([open])")];
    for (const fold of opened) fold.open = true;
  });
  window.addEventListener("afterprint", () => {
    for (const fold of opened) fold.open = false;
  });
  document.addEventListener("click", (event) => {
    const link = event.target.closest('a[href^="#"]');
    if (link) openNamed(link.hash);
  });
  openNamed(window.location.hash);
}
