"""Hooks of mkdocs.yml: pages of the project outside docs become pages of the site, and links to its other files lead to copies
of them."""

import os
import pathlib
import posixpath
import re

from mkdocs.exceptions import PluginError
from mkdocs.structure.files import File

ROOT = pathlib.Path(__file__).resolve().parent.parent
PAGES = {"README.md": "index.md", "ARCHITECTURE.md": "architecture.md", "CHANGELOG.md": "changelog.md",
         "CONTRIBUTING.md": "contributing.md", "SECURITY.md": "security.md"}
PYTHON = """# The Python package

[The guide](python.md) shows how the package is used. This page is made from its docstrings and types.

::: etendue
    options:
      members: [load, load_dict, load_string, render, render_sensors, resume, merge, start, compare, verify, read_image, write_image, tonemap,
        denoise, diff, show, plugins, integrator, limit_memory, look_at, rotate, scale, translate, Result, Job, Progress,
        FilmView, RayHits, SensorRays, Bsdfs, BsdfSamples, Diff, CompareReport, VerifyReport, Integrator, RenderError]

## The compiled classes

::: etendue._etendue
    options:
      show_root_heading: false
      show_root_toc_entry: false
      heading_level: 3

## The path space

::: etendue.core
    options:
      show_root_heading: false
      show_root_toc_entry: false
      heading_level: 3
"""
LINK = re.compile(r"(\]\(\s*<?|\s(?:src|href)=\")([^)\s>\"#]+)")


def source_of(page):
    """The folder, relative to ROOT, from which the links of a page begin."""
    if page.src_uri in PAGES.values():
        return ""
    return posixpath.dirname(posixpath.join("docs", page.src_uri))


def on_files(files, config):
    for source, name in PAGES.items():
        files.append(File.generated(config, name, content=(ROOT / source).read_text()))
    page = PYTHON
    if "ETENDUE_PYTHON" not in os.environ:
        page = page[:page.index("## The compiled")] + page[page.index("## The path space"):]
    files.append(File.generated(config, "python-reference.md", content=page))
    files.append(File.generated(config, "worker.js", abs_src_path=str(ROOT / "scripts/site_worker.js")))
    return files


def with_own_worker(output, worker, name):
    """A page that loads the script of the search from this site."""
    output, count = re.subn(r'<script src="https://unpkg.com/iframe-worker/shim"></script>',
                            f'<script src="{worker}"></script>', output)
    if count != 1:
        raise PluginError(f"{name}: it does not load the script of the search as it did")
    return output


def on_post_page(output, page, config):
    """The pages load nothing from other sites, which scripts/links checks."""
    worker = posixpath.relpath("worker.js", posixpath.dirname(page.file.dest_uri) or ".")
    return with_own_worker(output, worker, page.file.src_uri)


def on_post_template(output_content, template_name, config):
    """The links of this page begin at the root of a server."""
    return with_own_worker(output_content, "/worker.js", template_name) if template_name == "404.html" else output_content


def on_page_markdown(markdown, page, config, files):
    folder = source_of(page.file)

    def replaced(match):
        target = match[2]
        if re.match(r"[a-z]+:", target):
            return match[0]
        path = posixpath.normpath(posixpath.join(folder, target))  # relative to ROOT
        inside = path.removeprefix("docs/")
        if path in PAGES:
            name = PAGES[path]
        elif path.startswith("docs/") and files.get_file_from_path(inside):
            name = inside
        elif path == "docs/integrators":
            name = "integrators/path.md"
        elif (ROOT / path).is_file():
            name = f"files/{inside if path.startswith('docs/') else path}"
            if not files.get_file_from_path(name):
                files.append(File.generated(config, name, abs_src_path=str(ROOT / path)))
        elif (ROOT / path).is_dir():
            raise PluginError(f"{page.file.src_uri}: {target} is a folder, which the site does not have; link one of its files")
        else:
            return match[0]
        if match[1].endswith('"'):  # HTML is not rewritten by the generator, which makes .html of .md.
            name = re.sub(r"\.md$", ".html", name)
        return match[1] + posixpath.relpath(name, posixpath.dirname(page.file.src_uri) or ".")

    parts = []
    for part in re.split(r"(^```.*?^```[ ]*$)", markdown, flags=re.MULTILINE | re.DOTALL):
        parts.append(part if part.startswith("```") else LINK.sub(replaced, part))
    return "".join(parts)
