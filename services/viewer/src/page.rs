//! The files of the page, which are part of the binary.

/// A file of the page.
#[derive(Debug, Clone, Copy)]
pub(crate) struct File {
    path: &'static str,
    pub(crate) content_type: &'static str,
    pub(crate) body: &'static str,
}

const HTML: &str = "text/html";
const CSS: &str = "text/css";
const SCRIPT: &str = "text/javascript";

const FILES: &[File] = &[
    File { path: "/", content_type: HTML, body: include_str!("../page/index.html") },
    File { path: "/style.css", content_type: CSS, body: include_str!("../page/style.css") },
    File { path: "/main.js", content_type: SCRIPT, body: include_str!("../page/main.js") },
    File { path: "/link.js", content_type: SCRIPT, body: include_str!("../page/link.js") },
    File { path: "/tiles.js", content_type: SCRIPT, body: include_str!("../page/tiles.js") },
    File { path: "/map.js", content_type: SCRIPT, body: include_str!("../page/map.js") },
    File { path: "/overlay.js", content_type: SCRIPT, body: include_str!("../page/overlay.js") },
    File { path: "/camera.js", content_type: SCRIPT, body: include_str!("../page/camera.js") },
    File { path: "/processes.js", content_type: SCRIPT, body: include_str!("../page/processes.js") },
    File { path: "/replay.js", content_type: SCRIPT, body: include_str!("../page/replay.js") },
];

/// The file at this path.
pub(crate) fn file(path: &str) -> Option<&'static File> {
    FILES.iter().find(|file| file.path == path)
}

/// Whether the file is public: scripts and styles need no token, because a page cannot pass its token to them, and contain no data of
/// the robot.
pub(crate) fn is_public(path: &str) -> bool {
    path != "/" && file(path).is_some()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_page_names_only_files_that_are_served() {
        for each in FILES {
            for scheme in ["http://", "https://", "//cdn", "@import"] {
                assert!(!each.body.contains(scheme), "{} names another server: {scheme}", each.path);
            }
            let names = each.body.split(['"', '\'']).filter(|word| word.ends_with(".js") || word.ends_with(".css"));
            for name in names {
                let path = format!("/{}", name.trim_start_matches("./").trim_start_matches('/'));
                assert!(file(&path).is_some(), "{} names {name}, which is not served", each.path);
            }
        }
        assert!(is_public("/main.js") && !is_public("/") && !is_public("/live"));
    }
}
