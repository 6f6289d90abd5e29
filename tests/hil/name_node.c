// SPDX-License-Identifier: GPL-2.0
/*
 * A kernel module for the virtual machine: gives the controller of the emulated USB bus the
 * firmware path that real ones have, from which libcamera makes the name of a USB camera.
 */
#include <linux/module.h>
#include <linux/platform_device.h>

static char *device = "vhci_hcd.0";
module_param(device, charp, 0444);
MODULE_PARM_DESC(device, "platform device that gets the path");

static struct device *found;

static ssize_t path_show(struct device *dev, struct device_attribute *attribute, char *buffer)
{
    return sysfs_emit(buffer, "\\_SB_.FOVEA\n");
}
static DEVICE_ATTR_RO(path);

static struct attribute *attributes[] = {&dev_attr_path.attr, NULL};
static const struct attribute_group group = {.name = "firmware_node", .attrs = attributes};

static int __init name_node_init(void)
{
    int failed;

    found = bus_find_device_by_name(&platform_bus_type, NULL, device);
    if (!found) return -ENODEV;
    failed = sysfs_create_group(&found->kobj, &group);
    if (failed) put_device(found);
    return failed;
}

static void __exit name_node_exit(void)
{
    sysfs_remove_group(&found->kobj, &group);
    put_device(found);
}

module_init(name_node_init);
module_exit(name_node_exit);
MODULE_DESCRIPTION("A firmware path for an emulated USB controller");
MODULE_LICENSE("GPL");
