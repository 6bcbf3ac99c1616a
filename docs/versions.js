// Versions of the site, the newest first; each lies in a folder of its name beside the others.
window.siteVersions = ["1.19.0"];
