#!/usr/bin/env python3
"""Says which graphics interface this machine has, by opening it as the renderer does.

Prints one line, `Vulkan` or `GL through EGL`, and exits 0; prints what is missing and exits 1 if there is neither.
A driver's files may lie there and still not start, so nothing less than starting them is asked.
"""

import ctypes
import sys
from ctypes import POINTER, Structure, byref, c_char_p, c_int32, c_uint32, c_void_p


class VulkanInstanceCreateInfo(Structure):
    """`VkInstanceCreateInfo`, with neither layers nor extensions."""

    _fields_ = [
        ("structure_type", c_uint32),
        ("next", c_void_p),
        ("flags", c_uint32),
        ("application", c_void_p),
        ("layer_count", c_uint32),
        ("layers", POINTER(c_char_p)),
        ("extension_count", c_uint32),
        ("extensions", POINTER(c_char_p)),
    ]


def vulkan_problem():
    """None if a Vulkan driver offers at least one device, else what is missing."""
    try:
        library = ctypes.CDLL("libvulkan.so.1")
    except OSError:
        return "no libvulkan.so.1"
    structure_type_instance = 1
    info, instance, count = VulkanInstanceCreateInfo(structure_type_instance), c_void_p(), c_uint32()
    if library.vkCreateInstance(byref(info), None, byref(instance)) != 0:
        return "libvulkan.so.1 finds no driver"
    status = library.vkEnumeratePhysicalDevices(instance, byref(count), None)
    library.vkDestroyInstance(instance, None)
    return None if status == 0 and count.value > 0 else "the Vulkan driver offers no device"


def egl_problem():
    """None if EGL can draw without a screen, else what is missing."""
    try:
        library = ctypes.CDLL("libEGL.so.1")
        library.eglGetPlatformDisplay.restype = c_void_p
        library.eglGetDisplay.restype = c_void_p
    except (OSError, AttributeError):
        return "no libEGL.so.1"
    platform_surfaceless = 0x31DD
    displays = (
        lambda: library.eglGetPlatformDisplay(c_uint32(platform_surfaceless), None, None),
        lambda: library.eglGetDisplay(None),
    )
    for open_display in displays:
        display, major, minor = open_display(), c_int32(), c_int32()
        if display and library.eglInitialize(c_void_p(display), byref(major), byref(minor)):
            return None
    return "libEGL.so.1 finds no driver"


def main():
    problems = []
    for name, find_problem in (("Vulkan", vulkan_problem), ("GL through EGL", egl_problem)):
        problem = find_problem()
        if problem is None:
            print(name)
            return 0
        problems.append(f"{name}: {problem}")
    print("; ".join(problems))
    return 1


if __name__ == "__main__":
    sys.exit(main())
