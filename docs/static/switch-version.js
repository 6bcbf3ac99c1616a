// Fills the list of versions, and opens the page of the chosen one.
{
  const chosen = document.getElementById("version");
  const own = chosen.value;
  const names = window.siteVersions || [];
  const all = names.includes(own) ? names : [own, ...names];
  chosen.replaceChildren(...all.map((name) => new Option(name, name, name === own, name === own)));
  // A page that the browser kept shows its own version again.
  window.addEventListener("pageshow", () => { chosen.value = own; });
  chosen.addEventListener("change", async () => {
    const list = new URL(chosen.dataset.list, location.href);
    const folder = new URL(`../${encodeURIComponent(chosen.value)}/`, list);
    const page = new URL(chosen.dataset.page, folder);
    let exists = false;
    // Browsers do not fetch from folders of the disk; there the first page opens.
    if (location.protocol !== "file:") {
      exists = await fetch(page, { method: "HEAD" }).then((answer) => answer.ok, () => false);
    }
    location.assign(exists ? page : new URL("index.html", folder));
  });
}
