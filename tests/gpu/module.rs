//! A compute kernel written in SPIR-V, so that these tests need no kernel of the renderer's.

use rspirv::{
    binary::Assemble,
    dr::{Builder, Operand},
    spirv::{
        AddressingModel, BuiltIn, Capability, Decoration, ExecutionMode, ExecutionModel, FunctionControl, MemoryModel,
        SelectionControl, StorageClass,
    },
};
use std::mem::offset_of;
use translucent::shared::{Slot, Step};

/// `if (index < step.pixel_count) counters[index] = 3 * counters[index] + step.sample_index + PROJECTION;` with
/// the index that `Kernel::new` prescribes. It declares, and does not use, the capability `unused`.
pub fn triple_and_add(unused: Option<Capability>) -> Vec<u8> {
    let mut b = Builder::new();
    b.set_version(1, 6);
    b.capability(Capability::Shader);
    if let Some(capability) = unused {
        b.capability(capability);
    }
    b.memory_model(AddressingModel::Logical, MemoryModel::GLSL450);

    let void = b.type_void();
    let bool = b.type_bool();
    let uint = b.type_int(32, 0);
    let uvec3 = b.type_vector(uint, 3);
    let constant = |b: &mut Builder, value: usize| b.constant_bit32(uint, value as u32);
    let [zero, one, three] = [0, 1, 3].map(|value| constant(&mut b, value));
    let specialized = |b: &mut Builder, id: u32| {
        let value = b.spec_constant_bit32(uint, 1);
        b.decorate(value, Decoration::SpecId, [Operand::LiteralBit32(id)]);
        value
    };
    let workgroup = specialized(&mut b, 0);
    let projection = specialized(&mut b, 1);

    let block = |b: &mut Builder, member: u32, stride: Operand, class: StorageClass| {
        b.decorate(member, Decoration::ArrayStride, [stride]);
        let block = b.type_struct([member]);
        b.decorate(block, Decoration::Block, []);
        b.member_decorate(block, 0, Decoration::Offset, [Operand::LiteralBit32(0)]);
        let pointer = b.type_pointer(None, class, block);
        (b.variable(pointer, None, class, None), b.type_pointer(None, class, uint))
    };
    let stride = || Operand::LiteralBit32(4);
    let words = constant(&mut b, size_of::<Step>() / 4);
    let step_words = b.type_array(uint, words);
    let (step, step_word) = block(&mut b, step_words, stride(), StorageClass::PushConstant);
    let counter_words = b.type_runtime_array(uint);
    let (counters, counter) = block(&mut b, counter_words, stride(), StorageClass::StorageBuffer);
    b.decorate(counters, Decoration::DescriptorSet, [Operand::LiteralBit32(0)]);
    b.decorate(counters, Decoration::Binding, [Operand::LiteralBit32(Slot::Counters as u32)]);
    let input = b.type_pointer(None, StorageClass::Input, uvec3);
    let [group, groups, global] =
        [BuiltIn::WorkgroupId, BuiltIn::NumWorkgroups, BuiltIn::GlobalInvocationId].map(|built_in| {
            let variable = b.variable(input, None, StorageClass::Input, None);
            b.decorate(variable, Decoration::BuiltIn, [Operand::BuiltIn(built_in)]);
            variable
        });
    let pixel_count = constant(&mut b, offset_of!(Step, pixel_count) / 4);
    let sample_index = constant(&mut b, offset_of!(Step, sample_index) / 4);

    let main_type = b.type_function(void, []);
    let main = b.begin_function(void, None, FunctionControl::NONE, main_type).expect("builder");
    b.entry_point(ExecutionModel::GLCompute, main, "main", [step, counters, group, groups, global]);
    b.execution_mode_id(main, ExecutionMode::LocalSizeId, [workgroup, one, one]);
    b.begin_block(None).expect("builder");
    let part = |b: &mut Builder, variable, component| {
        let vector = b.load(uvec3, None, variable, None, []).expect("builder");
        b.composite_extract(uint, None, vector, [component]).expect("builder")
    };
    let row = part(&mut b, group, 1);
    let columns = part(&mut b, groups, 0);
    let x = part(&mut b, global, 0);
    let before = b.i_mul(uint, None, row, columns).expect("builder");
    let before = b.i_mul(uint, None, before, workgroup).expect("builder");
    let index = b.i_add(uint, None, before, x).expect("builder");
    let load = |b: &mut Builder, pointer, base, at| {
        let address = b.access_chain(pointer, None, base, [zero, at]).expect("builder");
        (address, b.load(uint, None, address, None, []).expect("builder"))
    };
    let (_, count) = load(&mut b, step_word, step, pixel_count);
    let inside = b.u_less_than(bool, None, index, count).expect("builder");
    let (work, end) = (b.id(), b.id());
    b.selection_merge(end, SelectionControl::NONE).expect("builder");
    b.branch_conditional(inside, work, end, []).expect("builder");

    b.begin_block(Some(work)).expect("builder");
    let (address, old) = load(&mut b, counter, counters, index);
    let (_, add) = load(&mut b, step_word, step, sample_index);
    let tripled = b.i_mul(uint, None, old, three).expect("builder");
    let sum = b.i_add(uint, None, tripled, add).expect("builder");
    let sum = b.i_add(uint, None, sum, projection).expect("builder");
    b.store(address, sum, None, []).expect("builder");
    b.branch(end).expect("builder");
    b.begin_block(Some(end)).expect("builder");
    b.ret().expect("builder");
    b.end_function().expect("builder");

    b.module().assemble().iter().flat_map(|word| word.to_le_bytes()).collect()
}
