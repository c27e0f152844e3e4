//! What Rust and GLSL share is the same on both sides: offsets in the SPIR-V, and the checked-in header.

use rspirv::{
    binary::{Consumer, ParseAction, parse_words},
    dr::{Instruction, ModuleHeader, Operand},
    spirv::{Decoration, Op},
};
use std::collections::{BTreeMap, BTreeSet, HashMap};
use translucent::{render::SPIRV, shared};

/// All instructions in order; rspirv's own loader does not know where OpExecutionModeId belongs.
#[derive(Default)]
struct Instructions(Vec<Instruction>);

impl Consumer for Instructions {
    fn initialize(&mut self) -> ParseAction {
        ParseAction::Continue
    }
    fn finalize(&mut self) -> ParseAction {
        ParseAction::Continue
    }
    fn consume_header(&mut self, _: ModuleHeader) -> ParseAction {
        ParseAction::Continue
    }
    fn consume_instruction(&mut self, instruction: Instruction) -> ParseAction {
        self.0.push(instruction);
        ParseAction::Continue
    }
}

/// Struct name -> member name -> byte offset, as a module declares them.
fn layouts(spirv: &[u8]) -> BTreeMap<String, BTreeMap<String, usize>> {
    let mut module = Instructions::default();
    parse_words(bytemuck::pod_collect_to_vec::<u8, u32>(spirv), &mut module).expect("SPIR-V parses");
    let mut names: HashMap<u32, String> = HashMap::new();
    let mut members: HashMap<(u32, u32), String> = HashMap::new();
    for instruction in &module.0 {
        match (&instruction.class.opcode, instruction.operands.as_slice()) {
            (Op::Name, [Operand::IdRef(id), Operand::LiteralString(name)]) => {
                names.insert(*id, name.clone());
            }
            (Op::MemberName, [Operand::IdRef(id), Operand::LiteralBit32(member), Operand::LiteralString(name)]) => {
                members.insert((*id, *member), name.clone());
            }
            _ => {}
        }
    }
    let mut layouts: BTreeMap<String, BTreeMap<String, usize>> = BTreeMap::new();
    for instruction in &module.0 {
        if let (
            Op::MemberDecorate,
            [
                Operand::IdRef(id),
                Operand::LiteralBit32(member),
                Operand::Decoration(Decoration::Offset),
                Operand::LiteralBit32(offset),
            ],
        ) = (&instruction.class.opcode, instruction.operands.as_slice())
        {
            let name = names.get(id).cloned().unwrap_or_default();
            layouts.entry(name).or_default().insert(members[&(*id, *member)].clone(), *offset as usize);
        }
    }
    layouts
}

#[test]
fn offsets_in_spirv_are_those_of_rust() {
    let mut seen = BTreeSet::new();
    for (stem, spirv) in SPIRV {
        let layouts = layouts(spirv);
        for expected in shared::STRUCTS {
            let Some(found) = layouts.get(expected.name) else { continue };
            seen.insert(expected.name);
            for (member, offset) in expected.members {
                assert_eq!(found.get(*member), Some(offset), "{stem}: {}.{member}", expected.name);
            }
            assert_eq!(found.len(), expected.members.len(), "{stem}: members of {}", expected.name);
        }
    }
    let all: BTreeSet<_> = shared::STRUCTS.iter().map(|layout| layout.name).collect();
    assert_eq!(seen, all, "every shared struct lies in a buffer of some kernel");
}

#[test]
fn header_in_the_repository_is_fresh() {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/glsl/shared.glsl");
    let fresh = shared::glsl();
    if std::env::var_os("BLESS").is_some() {
        std::fs::write(path, &fresh).expect("glsl/shared.glsl is writable");
    }
    let kept = std::fs::read_to_string(path).unwrap_or_default();
    assert!(kept == fresh, "glsl/shared.glsl is stale: BLESS=1 cargo test --test kernels header");
}

#[test]
fn push_constants_fit_every_device() {
    assert!(size_of::<shared::Step>() <= 128, "the core guarantee");
    // What the Vulkan Roadmap 2022 milestone promises; the core itself promises 4.
    assert!(shared::Slot::ALL.len() <= 30, "few slots, so that most devices have enough");
}
