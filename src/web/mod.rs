//! The page at `/`: sessions, the newest overlay, and who is placed where, live.
//!
//! Imports nothing of the crate. Plain HTML, CSS and JavaScript, embedded, with nothing from elsewhere.

/// A file of the page.
#[derive(Debug, Clone, Copy)]
pub struct Asset {
    /// Where it is served.
    pub path: &'static str,
    /// Its media type.
    pub media_type: &'static str,
    /// What it holds.
    pub content: &'static str,
}

/// All files of the page.
pub const ASSETS: [Asset; 4] = [
    Asset {
        path: "/",
        media_type: "text/html; charset=utf-8",
        content: include_str!("index.html"),
    },
    Asset {
        path: "/assets/page.css",
        media_type: "text/css; charset=utf-8",
        content: include_str!("page.css"),
    },
    Asset {
        path: "/assets/page.js",
        media_type: "text/javascript; charset=utf-8",
        content: include_str!("page.js"),
    },
    Asset {
        path: "/assets/icon.svg",
        media_type: "image/svg+xml",
        content: include_str!("icon.svg"),
    },
];

/// The page loads its own files and asks its own server, nothing else; nobody may frame it.
pub const CSP: &str = "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self'; connect-src 'self'; \
                       base-uri 'none'; form-action 'none'; frame-ancestors 'none'";

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_page_is_made_of_its_own_files_alone() {
        for asset in ASSETS {
            let elsewhere = asset.content.replace("http://www.w3.org/2000/svg", "");
            assert!(
                !elsewhere.contains("http://") && !elsewhere.contains("https://"),
                "{} names something elsewhere",
                asset.path
            );
        }
        let page = ASSETS[0].content;
        assert!(!page.contains("style=") && !page.contains("onclick") && !page.contains("<script>"));
    }
}
