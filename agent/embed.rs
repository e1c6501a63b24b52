//! What the pages have in common: one file each, with its data and its pictures in it.

/// Where a template wants its data.
const DATA: &str = "{{DATA}}";
const SIGNS: &[u8; 64] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";

/// A page: `template` with `json` in the place of `{{DATA}}`. Nothing in the data can end the element that holds it.
pub fn fill(template: &str, json: &str) -> String {
    // Not `replace` on the whole: data that has the mark in it must stay as it is.
    let data = json.replace('<', "\\u003c").replace('>', "\\u003e");
    let (before, after) = template.split_once(DATA).unwrap_or((template, ""));
    [before, &data, after].concat()
}

/// Bytes as a URI that needs nothing from outside.
pub fn data_uri(media_type: &str, bytes: &[u8]) -> String {
    format!("data:{media_type};base64,{}", base64(bytes))
}

fn base64(bytes: &[u8]) -> String {
    let mut text = String::with_capacity(bytes.len().div_ceil(3) * 4);
    for three in bytes.chunks(3) {
        let byte = |index: usize| u32::from(three.get(index).copied().unwrap_or(0));
        let bits = byte(0) << 16 | byte(1) << 8 | byte(2);
        for place in 0..4 {
            let sign = SIGNS[(bits >> (18 - 6 * place) & 63) as usize];
            text.push(if place > three.len() { '=' } else { char::from(sign) });
        }
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn base64_is_as_in_its_standard() {
        for (plain, coded) in [("", ""), ("f", "Zg=="), ("fo", "Zm8="), ("foo", "Zm9v"), ("foobar", "Zm9vYmFy")] {
            assert_eq!(base64(plain.as_bytes()), coded);
        }
    }

    #[test]
    fn data_cannot_leave_its_place() {
        let page = fill("<p>{{DATA}}</p>", r#""</p><b>{{DATA}}""#);
        assert_eq!(page, r#"<p>"\u003c/p\u003e\u003cb\u003e{{DATA}}"</p>"#);
    }
}
