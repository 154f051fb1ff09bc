//! The JSON schema and the reference page, made from the types.

use serde_json::Value;

use crate::Settings;

/// The text before the keys.
const HEAD: &str = "\
# Settings

A deployment of stillmap is one TOML file. A key that is left out has its default. An unknown key, a value outside its
limits and a key that nothing in the deployment reads are refused with file and line. Paths are relative to the folder
of the file. `stillmap check FILE` checks a file. Editors read `settings.schema.json`.

This page is generated from the code:

```sh
stillmap check --reference > config/SETTINGS.md
stillmap check --schema > config/settings.schema.json
```
";

/// The JSON schema of a deployment's file, with a line end.
#[must_use]
pub fn schema() -> String {
    format!("{:#}\n", tree())
}

/// The option reference in Markdown: every section and key with its values, default and meaning.
#[must_use]
pub fn reference() -> String {
    let tree = tree();
    let keys = Page { definitions: &tree["$defs"] }.section("", &tree);
    format!("{HEAD}\n{keys}")
}

fn tree() -> Value {
    schemars::schema_for!(Settings).to_value()
}

struct Page<'a> {
    definitions: &'a Value,
}

impl Page<'_> {
    /// The keys of a table, then the tables within it, each under its own heading.
    fn section(&self, path: &str, table: &Value) -> String {
        let mut rows = String::from("| key | value | default | meaning |\n| --- | --- | --- | --- |\n");
        let mut tables = String::new();
        for (key, property) in table["properties"].as_object().into_iter().flatten() {
            let path = if path.is_empty() { key.clone() } else { format!("{path}.{key}") };
            let kind = self.resolved(property);
            let entry = self.resolved(&kind["items"]);
            let words = description(property);
            if is_table(kind) {
                tables += &format!("\n## [{path}]\n\n{words}\n\n{}", self.section(&path, kind));
            } else if is_table(entry) {
                tables += &format!("\n## [[{path}]], {} times\n\n{words}\n\n{}", list_form(kind), self.section(&path, entry));
            } else {
                rows += &format!("| `{key}` | {} | {} | {words} |\n", self.values(property), default_of(table, key, property));
            }
        }
        rows + &tables
    }

    /// The values that a key takes, in words.
    fn values(&self, property: &Value) -> String {
        let kind = self.resolved(property);
        if let Some(form) = kind["x-form"].as_str() {
            return form.to_owned();
        }
        if let Some(choices) = kind["oneOf"].as_array().or_else(|| kind["enum"].as_array()) {
            let words = choices.iter().map(|choice| format!("`{}`", choice.get("const").unwrap_or(choice)));
            return words.collect::<Vec<_>>().join(", ");
        }
        let unit = kind["x-unit"].as_str().map(|unit| format!(" {unit}")).unwrap_or_default();
        match (type_name(kind), kind["minimum"].as_f64(), kind["maximum"].as_f64()) {
            ("boolean", ..) => "`true`, `false`".to_owned(),
            ("array", ..) if kind["items"]["items"].is_object() => {
                format!("{} × {}: each {}", list_form(kind), list_form(&kind["items"]), self.values(&kind["items"]["items"]))
            }
            ("array", ..) => format!("list of {}: {}", list_form(kind), self.values(&kind["items"])),
            ("integer", Some(low), Some(high)) => format!("whole number, {low} to {high}{unit}"),
            (_, Some(low), Some(high)) => format!("{low} to {high}{unit}"),
            _ => "text".to_owned(),
        }
    }

    fn resolved<'v>(&'v self, schema: &'v Value) -> &'v Value {
        let reference = schema["$ref"].as_str().or_else(|| schema["anyOf"][0]["$ref"].as_str());
        let name = reference.and_then(|reference| reference.rsplit('/').next());
        name.and_then(|name| self.definitions.get(name)).unwrap_or(schema)
    }
}

fn is_table(kind: &Value) -> bool {
    kind["properties"].is_object()
}

/// The type that is not null: an option's keys are left out, for TOML has no null.
fn type_name(kind: &Value) -> &str {
    let types = kind["type"].as_array().map_or(core::slice::from_ref(&kind["type"]), Vec::as_slice);
    types.iter().filter_map(Value::as_str).find(|name| *name != "null").unwrap_or_default()
}

/// How many entries a list has: `3`, `1 to 23`.
fn list_form(kind: &Value) -> String {
    match (kind["minItems"].as_u64(), kind["maxItems"].as_u64()) {
        (Some(least), Some(most)) if least == most => format!("{most}"),
        (least, Some(most)) => format!("{} to {most}", least.unwrap_or_default()),
        (Some(least), None) => format!("{least} or more"),
        (None, None) => "any number".to_owned(),
    }
}

/// A doc comment without the heading that it starts with.
fn description(property: &Value) -> String {
    let words = property["description"].as_str().unwrap_or_default().replace('\n', " ");
    match words.split_once("`: ") {
        Some((heading, rest)) if heading.starts_with("`[") => {
            let mut letters = rest.chars();
            letters.next().map(|first| first.to_uppercase().chain(letters).collect()).unwrap_or_default()
        }
        _ => words,
    }
}

fn default_of(table: &Value, key: &str, property: &Value) -> String {
    let required = table["required"].as_array().is_some_and(|names| names.iter().any(|name| name == key));
    match property.get("default") {
        Some(default) => format!("`{}`", default.to_string().replace(',', ", ")),
        None if required => "**required**".to_owned(),
        None => "none".to_owned(),
    }
}
