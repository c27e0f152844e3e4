//! A reader of Amber's scripts, as far as dumps use them: the grammar of google/amber, docs/amber_script.md, and what
//! its parser makes of bytes in SPIRV-HEX.

use std::collections::BTreeMap;

#[derive(Debug, Default)]
pub struct Script {
    pub spirv: Vec<u8>,
    pub buffers: BTreeMap<String, Vec<u32>>,
    pub push_constants: String,
    /// By binding in descriptor set 0.
    pub bindings: BTreeMap<u32, String>,
    pub specialization: Vec<(u32, u32)>,
    pub groups: Vec<u32>,
    /// Buffers and those that they must equal.
    pub expected: Vec<(String, String)>,
}

type Parsed<T> = Result<T, String>;

fn require(holds: bool, problem: impl Into<String>) -> Parsed<()> {
    if holds { Ok(()) } else { Err(problem.into()) }
}

fn number(word: &str) -> Parsed<u32> {
    word.parse().map_err(|_| format!("{word} is no number of 32 bits"))
}

pub fn parse(text: &str) -> Parsed<Script> {
    let mut rest = text.strip_prefix("#!amber\n").ok_or("the first line is not #!amber")?;
    let (mut script, mut shader, mut pipeline) = (Script::default(), None, None);
    while !rest.is_empty() {
        let words = statement(&mut rest);
        match words[..] {
            [] => {}
            ["SHADER", "compute", name, "SPIRV-HEX"] => {
                require(shader.replace(name).is_none(), "two shaders")?;
                let end = rest.find("END").ok_or("SHADER missing END")?;
                script.spirv = hex(&rest[..end])?;
                rest = &rest[end..];
                require(statement(&mut rest) == ["END"], "more after END")?;
            }
            ["BUFFER", name, "DATA_TYPE", "uint32", "DATA"] => {
                let mut values = vec![];
                loop {
                    require(!rest.is_empty(), "BUFFER missing END")?;
                    match statement(&mut rest)[..] {
                        ["END"] => break,
                        ref words => {
                            for word in words {
                                values.push(number(word)?);
                            }
                        }
                    }
                }
                require(!values.is_empty(), format!("{name} has no data"))?;
                require(script.buffers.insert(name.into(), values).is_none(), format!("{name} is there twice"))?;
            }
            ["PIPELINE", "compute", name] => {
                require(pipeline.replace(name).is_none(), "two pipelines")?;
                loop {
                    require(!rest.is_empty(), "PIPELINE missing END")?;
                    match statement(&mut rest)[..] {
                        ["END"] => break,
                        ref words => body(&mut script, words, shader)?,
                    }
                }
            }
            ["RUN", name, x, y, z] => {
                require(Some(name) == pipeline && script.groups.is_empty(), format!("RUN {name}"))?;
                script.groups = vec![number(x)?, number(y)?, number(z)?];
            }
            ["EXPECT", found, "EQ_BUFFER", expected] => {
                require(!script.groups.is_empty(), "EXPECT before RUN")?;
                let sizes = [found, expected].map(|name| script.buffers.get(name).map(Vec::len));
                require(sizes[0].is_some() && sizes[0] == sizes[1], format!("{found} and {expected}: {sizes:?}"))?;
                script.expected.push((found.into(), expected.into()));
            }
            _ => return Err(format!("unknown: {}", words.join(" "))),
        }
    }
    require(!script.groups.is_empty(), "nothing runs")?;
    Ok(script)
}

/// The words of the next line, without a comment.
fn statement<'a>(rest: &mut &'a str) -> Vec<&'a str> {
    let (line, after) = rest.split_once('\n').unwrap_or((rest, ""));
    *rest = after;
    line.split('#').next().unwrap_or_default().split_whitespace().collect()
}

/// Within a pipeline.
fn body(script: &mut Script, words: &[&str], shader: Option<&str>) -> Parsed<()> {
    match *words {
        ["ATTACH", name, "ENTRY_POINT", "main", ref constants @ ..] => {
            require(Some(name) == shader, format!("no shader {name}"))?;
            for constant in constants.chunks(5) {
                let &["SPECIALIZE", id, "AS", "uint32", value] = constant else { return Err(constant.join(" ")) };
                script.specialization.push((number(id)?, number(value)?));
            }
        }
        ["BIND", "BUFFER", name, "AS", "push_constant"] => {
            require(script.buffers.contains_key(name) && script.push_constants.is_empty(), name)?;
            script.push_constants = name.into();
        }
        ["BIND", "BUFFER", name, "AS", "storage", "DESCRIPTOR_SET", "0", "BINDING", binding] => {
            require(script.buffers.contains_key(name), format!("no buffer {name}"))?;
            let taken = script.bindings.insert(number(binding)?, name.into());
            require(taken.is_none(), format!("binding {binding} is there twice"))?;
        }
        _ => return Err(format!("unknown in PIPELINE: {}", words.join(" "))),
    }
    Ok(())
}

/// Amber reads number after number until the text ends, and never gets past white space at its end.
fn hex(text: &str) -> Parsed<Vec<u8>> {
    require(!text.ends_with(char::is_whitespace), "white space before the shader's END")?;
    let byte = |word: &str| word.strip_prefix("0x").and_then(|digits| u8::from_str_radix(digits, 16).ok());
    text.split_whitespace().map(|word| byte(word).ok_or_else(|| format!("{word} is no byte"))).collect()
}

#[test]
fn the_reader_refuses_what_amber_would() {
    let good = "#!amber\nSHADER compute k SPIRV-HEX\n0x03 0x02END\nBUFFER a DATA_TYPE uint32 DATA\n1 2\nEND\n\
                BUFFER b DATA_TYPE uint32 DATA\n3 4\nEND\nPIPELINE compute p\n  ATTACH k ENTRY_POINT main SPECIALIZE 1 \
                AS uint32 2\n  BIND BUFFER a AS storage DESCRIPTOR_SET 0 BINDING 3\nEND # p\nRUN p 1 1 1\n\
                EXPECT a EQ_BUFFER b\n";
    let script = parse(good).expect("it is valid");
    assert_eq!((script.spirv, script.specialization, script.groups), (vec![3, 2], vec![(1, 2)], vec![1, 1, 1]));
    for (text, with) in [
        ("#!amber\n", "\n"),
        ("0x02END", "0x02\nEND"),
        ("0x02", "0x07230203"),
        ("1 2\nEND", "1 2\n"),
        ("3 4", "3"),
        ("3 4", "3 0.5"),
        ("EXPECT a", "EXPECT c"),
        ("BUFFER a AS", "BUFFER c AS"),
        ("BUFFER b DATA_TYPE", "BUFFER a DATA_TYPE"),
        ("END # p", "  BIND BUFFER b AS storage DESCRIPTOR_SET 0 BINDING 3\nEND"),
        ("END # p", ""),
        ("SPECIALIZE 1", "\n  SPECIALIZE 1"),
        ("RUN p", "RUN q"),
    ] {
        assert!(good.contains(text) && parse(&good.replacen(text, with, 1)).is_err(), "{text} -> {with}");
    }
}
