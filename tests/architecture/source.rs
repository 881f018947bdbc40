//! What a Rust file names: every path, macro and method of it, with imports resolved, its line, and whether it is
//! test code. Comments and strings name nothing, which is why this reads tokens and not text.

use std::collections::HashMap;
use std::rc::Rc;

use proc_macro2::{Delimiter, Spacing, TokenStream, TokenTree};

/// One use of a name.
#[derive(Debug, PartialEq)]
pub(crate) struct Name {
    /// The path with imports, `self` and `super` resolved; one segment for macros and methods.
    pub(crate) path: Vec<String>,
    pub(crate) kind: Kind,
    /// Counted from 1.
    pub(crate) line: usize,
    /// Whether it stands under `#[cfg(test)]`.
    pub(crate) test: bool,
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Kind {
    /// A leaf of a `use` declaration.
    Import,
    /// A path anywhere else; a lone identifier, too.
    Path,
    /// `name!(..)`
    Macro,
    /// `.name`
    Method,
}

/// What a file names, and the modules it declares under `#[cfg(test)]` in files of their own.
#[derive(Debug)]
pub(crate) struct Source {
    pub(crate) names: Vec<Name>,
    pub(crate) test_modules: Vec<Vec<String>>,
}

/// Reads a file's text; `module` is its path from the crate's root, `["crate", "scene", "camera"]`.
pub(crate) fn read(text: &str, module: &[String]) -> Result<Source, String> {
    let tokens: TokenStream = text.parse().map_err(|e| format!("is not Rust: {e}"))?;
    let mut flat = Flat::default();
    flat.flatten(tokens, &Rc::new(module.to_vec()), false);
    let imports = imports(&flat.lexemes);
    let aliases: HashMap<&str, &[String]> =
        imports.iter().map(|i| (i.alias.as_str(), i.path.as_slice())).collect();
    let mut names: Vec<Name> = imports
        .iter()
        .map(|i| Name { path: i.path.clone(), kind: Kind::Import, line: i.line, test: i.test })
        .collect();
    names.extend(uses(&flat.lexemes, &aliases));
    names.sort_by_key(|n| n.line);
    Ok(Source { names, test_modules: flat.test_modules })
}

/// An identifier, `::`, another sign, or a delimiter.
struct Lexeme {
    text: String,
    line: usize,
    test: bool,
    identifier: bool,
    /// Where it stands: inline modules count.
    module: Rc<Vec<String>>,
}

#[derive(Default)]
struct Flat {
    lexemes: Vec<Lexeme>,
    test_modules: Vec<Vec<String>>,
}

impl Flat {
    fn flatten(&mut self, tokens: TokenStream, module: &Rc<Vec<String>>, test: bool) {
        let trees: Vec<TokenTree> = tokens.into_iter().collect();
        // Set by `#[cfg(test)]`, holds to the end of the thing it stands before.
        let mut under_test = test;
        let mut inner = Rc::clone(module);
        for (i, tree) in trees.iter().enumerate() {
            let line = tree.span().start().line;
            let mut push = |text: String, identifier| {
                self.lexemes.push(Lexeme {
                    text,
                    line,
                    test: under_test,
                    identifier,
                    module: Rc::clone(module),
                });
            };
            match tree {
                TokenTree::Ident(ident) => {
                    let text = ident.to_string();
                    push(text.trim_start_matches("r#").to_owned(), true);
                    if i > 0 && matches!(&trees[i - 1], TokenTree::Ident(word) if word == "mod") {
                        let mut path = module.to_vec();
                        path.push(text);
                        match trees.get(i + 1) {
                            Some(TokenTree::Group(_)) => inner = Rc::new(path),
                            _ if under_test => self.test_modules.push(path),
                            _ => {}
                        }
                    }
                }
                TokenTree::Punct(sign) => {
                    if sign.as_char() == ':' && i > 0 && is_joint_colon(&trees[i - 1]) {
                        // The first one was pushed: `::` is one lexeme.
                        if let Some(last) = self.lexemes.last_mut() {
                            "::".clone_into(&mut last.text);
                        }
                    } else {
                        push(sign.to_string(), false);
                    }
                    if sign.as_char() == ';' {
                        under_test = test;
                    }
                }
                TokenTree::Literal(_) => push(String::new(), false),
                TokenTree::Group(group) => {
                    let (open, close) = match group.delimiter() {
                        Delimiter::Parenthesis => ("(", ")"),
                        Delimiter::Brace => ("{", "}"),
                        Delimiter::Bracket => ("[", "]"),
                        Delimiter::None => ("", ""),
                    };
                    push(open.to_owned(), false);
                    self.flatten(group.stream(), &inner, under_test);
                    self.lexemes.push(Lexeme {
                        text: close.to_owned(),
                        line: group.span_close().start().line,
                        test: under_test,
                        identifier: false,
                        module: Rc::clone(module),
                    });
                    inner = Rc::clone(module);
                    match group.delimiter() {
                        Delimiter::Brace => under_test = test,
                        Delimiter::Bracket if is_cfg_test(&group.stream()) => under_test = true,
                        _ => {}
                    }
                }
            }
        }
    }
}

fn is_joint_colon(tree: &TokenTree) -> bool {
    matches!(tree, TokenTree::Punct(p) if p.as_char() == ':' && p.spacing() == Spacing::Joint)
}

fn is_cfg_test(attribute: &TokenStream) -> bool {
    let words: Vec<String> = attribute.clone().into_iter().map(|t| t.to_string()).collect();
    words == ["cfg", "(test)"]
}

struct Import {
    alias: String,
    path: Vec<String>,
    line: usize,
    test: bool,
}

/// The leaves of all `use` declarations, groups taken apart.
fn imports(lexemes: &[Lexeme]) -> Vec<Import> {
    let mut leaves = Vec::new();
    for (i, lexeme) in lexemes.iter().enumerate() {
        if is_use(lexemes, i) {
            use_tree(lexemes, i + 1, &[], &mut leaves);
        } else if lexeme.text == "extern" && lexemes.get(i + 1).is_some_and(|l| l.text == "crate") {
            use_tree(lexemes, i + 2, &[], &mut leaves);
        }
    }
    leaves
}

/// `use` as a declaration, not as the `use<..>` of captured lifetimes.
fn is_use(lexemes: &[Lexeme], i: usize) -> bool {
    lexemes[i].text == "use" && lexemes.get(i + 1).is_some_and(|l| l.text != "<")
}

/// Reads one tree of a `use` declaration from `at`; returns where it ends.
fn use_tree(lexemes: &[Lexeme], mut at: usize, prefix: &[String], leaves: &mut Vec<Import>) -> usize {
    let mut path = prefix.to_vec();
    let mut alias = None;
    while let Some(lexeme) = lexemes.get(at) {
        match lexeme.text.as_str() {
            "{" => {
                at += 1;
                while lexemes.get(at).is_some_and(|l| l.text != "}") {
                    at = use_tree(lexemes, at, &path, leaves);
                    at += usize::from(lexemes.get(at).is_some_and(|l| l.text == ","));
                }
                return at + 1;
            }
            "as" => {
                alias = lexemes.get(at + 1).map(|l| l.text.clone());
                at += 1;
            }
            "," | ";" | "}" => break,
            // `a::{self}` is `a`.
            "self" if !path.is_empty() => {}
            "::" => {}
            word => path.push(word.to_owned()),
        }
        at += 1;
    }
    if let (Some(last), Some(first)) = (path.last(), lexemes.get(at.saturating_sub(1))) {
        let alias = alias.unwrap_or_else(|| last.clone());
        let path = absolute(&path, &first.module);
        leaves.push(Import { alias, path, line: first.line, test: first.test });
    }
    at
}

/// A path with its leading `self` and `super` replaced.
fn absolute(path: &[String], module: &[String]) -> Vec<String> {
    let up = path.iter().take_while(|s| *s == "super").count();
    if path.first().is_some_and(|s| s == "self") {
        [module, &path[1..]].concat()
    } else if up > 0 {
        [&module[..module.len().saturating_sub(up).max(1)], &path[up..]].concat()
    } else {
        path.to_vec()
    }
}

/// Every path, macro and method outside `use` declarations.
fn uses(lexemes: &[Lexeme], aliases: &HashMap<&str, &[String]>) -> Vec<Name> {
    let text = |i: usize| lexemes.get(i).map_or("", |l| l.text.as_str());
    let mut names = Vec::new();
    let mut i = 0;
    while i < lexemes.len() {
        if is_use(lexemes, i) {
            while i < lexemes.len() && text(i) != ";" {
                i += 1;
            }
            continue;
        }
        let first = &lexemes[i];
        if !first.identifier {
            i += 1;
            continue;
        }
        let method = i > 0 && text(i - 1) == ".";
        let mut path = vec![first.text.clone()];
        while !method && text(i + 1) == "::" && lexemes.get(i + 2).is_some_and(|l| l.identifier) {
            path.push(lexemes[i + 2].text.clone());
            i += 2;
        }
        let is_macro = text(i + 1) == "!" && matches!(text(i + 2), "(" | "[" | "{");
        let kind = match (method, is_macro) {
            (true, _) => Kind::Method,
            (_, true) => Kind::Macro,
            _ => Kind::Path,
        };
        let path = match kind {
            Kind::Path => resolve(&path, &first.module, aliases),
            _ => path.split_off(path.len() - 1),
        };
        names.push(Name { path, kind, line: first.line, test: first.test });
        i += 1;
    }
    names
}

/// A path with its first segment followed through the file's imports.
fn resolve(path: &[String], module: &[String], aliases: &HashMap<&str, &[String]>) -> Vec<String> {
    match aliases.get(path[0].as_str()) {
        Some(imported) => [imported, &path[1..]].concat(),
        None => absolute(path, module),
    }
}
