"""Links from a page to files of the repository outside of this folder lead to its web page."""

import posixpath
import re


def on_page_markdown(markdown, page, config, **_):
    folder = posixpath.dirname(page.file.src_uri)

    def absolute(match):
        path = posixpath.normpath(posixpath.join("docs", folder, match[1]))
        anchor = match[2] or ""
        if path.startswith("docs/"):
            return match[0]
        return f"]({config.repo_url}/blob/main/{path}{anchor})"

    return re.sub(r"\]\((\.\./[^)#]*)(#[^)]*)?\)", absolute, markdown)
