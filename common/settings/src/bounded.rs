//! Numbers with limits, of which the JSON schema and the settings reference state the limits.

/// [`document::bounded!`] with a JSON schema: `Name: f64 in 0.005..=1.0, "m", default 0.05;`.
macro_rules! bounded {
    ($($(#[$doc:meta])* $name:ident: $number:ident in $min:literal..=$max:literal, $unit:literal $(, default $default:literal)?;)+) => {
        document::bounded! { $($(#[$doc])* $name: $number in $min..=$max, $unit $(, default $default)?;)+ }
        $(impl schemars::JsonSchema for $name {
            fn schema_name() -> std::borrow::Cow<'static, str> {
                stringify!($name).into()
            }

            fn inline_schema() -> bool {
                true
            }

            fn json_schema(generator: &mut schemars::SchemaGenerator) -> schemars::Schema {
                let mut schema = <$number as schemars::JsonSchema>::json_schema(generator);
                schema.insert("minimum".to_owned(), serde_json::Value::from(Self::MIN.0));
                schema.insert("maximum".to_owned(), serde_json::Value::from(Self::MAX.0));
                if !$unit.is_empty() {
                    schema.insert("x-unit".to_owned(), serde_json::Value::from($unit));
                }
                schema
            }
        })+
    };
}

/// [`document::one_of!`] with a JSON schema: `Name: u32 of [9600, 19200];`.
macro_rules! one_of {
    ($($(#[$doc:meta])* $name:ident: $number:ident of [$($possible:literal),+] $(, default $default:literal)?;)+) => {
        document::one_of! { $($(#[$doc])* $name: $number of [$($possible),+] $(, default $default)?;)+ }
        $(impl schemars::JsonSchema for $name {
            fn schema_name() -> std::borrow::Cow<'static, str> {
                stringify!($name).into()
            }

            fn inline_schema() -> bool {
                true
            }

            fn json_schema(_: &mut schemars::SchemaGenerator) -> schemars::Schema {
                schemars::json_schema!({ "type": "integer", "enum": [$($possible),+] })
            }
        })+
    };
}

pub(crate) use {bounded, one_of};
