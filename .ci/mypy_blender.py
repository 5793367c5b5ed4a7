"""What the stubs of Blender's modules cannot know, told to mypy.

The type of an object tells nothing of its data, so that these are of any type. Some of what a context or a
panel may lack elsewhere is there wherever this extension's code runs, or it asks for that in ways that mypy
cannot follow.
"""

from collections.abc import Callable

from mypy.nodes import ARG_POS, Argument, Var
from mypy.plugin import AttributeContext, ClassDefContext, FunctionContext, MethodContext, Plugin
from mypy.plugins.common import add_method_to_class
from mypy.types import AnyType, NoneType, Type, TypeOfAny, UnionType, get_proper_type

OF_ANY_TYPE = {"bpy.types.Object.data"}
ALWAYS_THERE = {
    "bpy.types.AnimData.action",
    "bpy.types.Context.region",
    "bpy.types.Context.region_data",
    "bpy.types.Context.scene",
    "bpy.types.Context.view_layer",
    "bpy.types.Context.window_manager",
    "bpy.types.Material.node_tree",
    "bpy.types.Menu.layout",
    "bpy.types.NlaStrip.action",
    "bpy.types.Operator.layout",
    "bpy.types.Panel.layout",
}
# Of these the stubs say that they return nothing.
RETURNING = {
    "blf.dimensions",
    "bpy.types.BlendDataLibraries.load",
    "bpy.types.Object.ray_cast",
    "gpu.shader.from_builtin",
    "gpu.state.viewport_get",
    "mathutils.bvhtree.BVHTree.FromPolygons",
    "mathutils.interpolate.poly_3d_calc",
}


def _any(_context: AttributeContext | FunctionContext | MethodContext) -> Type:
    return AnyType(TypeOfAny.explicit)


def _custom_property(context: MethodContext) -> Type:
    """`get` of what is no collection: the stubs say that it returns nothing."""
    found = context.default_return_type
    return AnyType(TypeOfAny.explicit) if isinstance(get_proper_type(found), NoneType) else found


def _there(context: AttributeContext) -> Type:
    found = get_proper_type(context.default_attr_type)
    if not isinstance(found, UnionType):
        return found
    return UnionType.make_union(
        [item for item in found.items if not isinstance(get_proper_type(item), NoneType)]
    )


def _with_custom_properties(context: ClassDefContext) -> None:
    """Whatever has properties can be asked whether it has a custom one of this name."""
    name = context.api.named_type("builtins.str")
    argument = Argument(Var("name", name), name, None, ARG_POS)
    add_method_to_class(
        context.api, context.cls, "__contains__", [argument], context.api.named_type("builtins.bool")
    )


class BlenderPlugin(Plugin):
    def get_base_class_hook(self, fullname: str) -> Callable[[ClassDefContext], None] | None:
        return _with_custom_properties if fullname == "bpy.types.bpy_struct" else None

    def get_function_hook(self, fullname: str) -> Callable[[FunctionContext], Type] | None:
        return _any if fullname in RETURNING else None

    def get_method_hook(self, fullname: str) -> Callable[[MethodContext], Type] | None:
        if fullname.startswith("bpy.types.") and fullname.endswith(".get"):
            return _custom_property
        return _any if fullname in RETURNING else None

    def get_attribute_hook(self, fullname: str) -> Callable[[AttributeContext], Type] | None:
        if fullname in OF_ANY_TYPE:
            return _any
        return _there if fullname in ALWAYS_THERE else None


def plugin(_version: str) -> type[Plugin]:
    return BlenderPlugin
